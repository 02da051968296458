#include "can/dbc.h"

#include <array>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/signal.h"
#include "support/mutate_bytes.h"
#include "support/random.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr const char* kVehicle = R"(VERSION "1.0"

NS_ :
	NS_DESC_
	CM_
	BA_DEF_
	VAL_

BS_:

BU_: ECU XXX

BO_ 170 WHEEL_SPEEDS: 8 XXX
 SG_ FR : 6|15@0+ (0.01,-67.67) [0|250] "km/h" XXX
 SG_ FL : 22|15@0+ (0.01,-67.67) [0|250] "km/h" XXX

BO_ 2566844926 ENCODERS: 8 ECU
 SG_ MODE M : 0|4@1+ (1,0) [0|15] "" ECU,XXX
 SG_ TEMPERATURE m1 : 8|8@1- (1,-40) [-40|100] "°C" ECU
 SG_ VOLTAGE m2 : 8|16@1+ (1E-03,0) [0|65.535] "V" ECU
 SG_ LOAD : 32|32@1- (1,0) [0|0] "" ECU

BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ UNUSED : 0|8@1+ (1,0) [0|0] "" Vector__XXX

CM_ SG_ 170 FR "a comment; with
SG_ that is none and \"quotes\"";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
VAL_ 170 FR 0 "standing" 1 "moving" ;
SIG_VALTYPE_ 2566844926 LOAD : 1;
)";

TEST(DbcFileTest, ReadsMessagesAndSignals) {
  const auto dbc = DbcFile::Parse(kVehicle, "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  ASSERT_EQ(dbc->messages().size(), 3U);
  const DbcMessage& wheels = dbc->messages()[0];
  EXPECT_EQ(wheels.name, "WHEEL_SPEEDS");
  EXPECT_EQ(wheels.id, (CanId{.value = 0xAA}));
  EXPECT_EQ(wheels.size, 8);
  const DbcSignal* front_left = wheels.FindSignal("FL");
  ASSERT_NE(front_left, nullptr);
  EXPECT_EQ(front_left->start_bit, 22);
  EXPECT_EQ(front_left->length, 15);
  EXPECT_EQ(front_left->byte_order, ByteOrder::kBigEndian);
  EXPECT_EQ(front_left->type, RawType::kUnsigned);
  EXPECT_DOUBLE_EQ(front_left->factor, 0.01);
  EXPECT_DOUBLE_EQ(front_left->offset, -67.67);
  EXPECT_DOUBLE_EQ(front_left->maximum, 250.0);
  EXPECT_EQ(front_left->unit, "km/h");
  EXPECT_EQ(wheels.FindSignal("RL"), nullptr);
}

TEST(DbcFileTest, ReadsExtendedIdentifiersMultiplexingAndFloats) {
  const auto dbc = DbcFile::Parse(kVehicle, "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  const DbcMessage& encoders = dbc->messages()[1];
  EXPECT_EQ(encoders.id, (CanId{.value = 0x18FEF1FE, .extended = true}));
  EXPECT_TRUE(encoders.FindSignal("MODE")->is_multiplexor);
  EXPECT_EQ(encoders.FindSignal("VOLTAGE")->multiplexor, "MODE");
  EXPECT_EQ(encoders.FindSignal("LOAD")->type, RawType::kFloat);

  const DbcSignal& voltage = *encoders.FindSignal("VOLTAGE");
  const std::array<std::uint8_t, 8> payload = {0x02, 0x10, 0x27};
  EXPECT_TRUE(IsPresent(encoders, voltage, payload));
  EXPECT_FALSE(IsPresent(encoders, *encoders.FindSignal("TEMPERATURE"), payload));
  EXPECT_DOUBLE_EQ(*DecodeSignal(voltage, payload), 10.0);
}

TEST(DbcFileTest, FindsASignalByItsFullName) {
  const auto dbc = DbcFile::Parse(kVehicle, "v.dbc");
  ASSERT_TRUE(dbc);
  const auto found = dbc->FindSignal("WHEEL_SPEEDS.FL");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->signal->name, "FL");
  EXPECT_EQ(dbc->FindSignal("WHEEL_SPEED.FL").error().message,
            "v.dbc: has no signal 'WHEEL_SPEED.FL', nearest are WHEEL_SPEEDS.FL, WHEEL_SPEEDS.FR, "
            "ENCODERS.LOAD");
}

struct DbcCase {
  const char* name;
  std::string text;
  const char* error;
};

class MalformedDbcTest : public testing::TestWithParam<DbcCase> {};

TEST_P(MalformedDbcTest, NamesFileLineValueAndWhatIsAllowed) {
  const auto dbc = DbcFile::Parse(GetParam().text, "v.dbc");
  ASSERT_FALSE(dbc);
  EXPECT_EQ(dbc.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(dbc.error().message, GetParam().error);
}

std::string InMessage(const std::string& signal_line) {
  return "BO_ 170 WHEELS: 8 XXX\n SG_ FR : 0|8@1+ (1,0) [0|0] \"\" XXX\n" + signal_line;
}

INSTANTIATE_TEST_SUITE_P(
    Files,
    MalformedDbcTest,
    testing::ValuesIn(std::vector<DbcCase>{
        {"Empty", "", "v.dbc: has no message (BO_), must have at least one"},
        {"Binary",
         "\x7f"
         "ELF",
         "v.dbc: line 1: '\x7f"
         "ELF', must begin with a keyword such as BO_ or SG_"},
        {"OpenSection",
         "BO_ 1 A: 8 X\nCM_ \"no end",
         "v.dbc: line 2: CM_ begins here and has no end, must end with ';'"},
        {"SignalFirst",
         "SG_ FR : 0|8@1+ (1,0) [0|0] \"\" X",
         "v.dbc: line 1: signal (SG_) before any message (BO_)"},
        {"NoIdentifier",
         "BO_ x A: 8 X",
         "v.dbc: line 1: message identifier is 'x', must be an integer from 0 to 4294967295"},
        {"WideIdentifier",
         "BO_ 2048 A: 8 X",
         "v.dbc: line 1: message identifier of A is 2048, must be up to 2047, or 2147483648 and up "
         "to 29 bits"},
        {"TooLong",
         "BO_ 1 A: 1786 X",
         "v.dbc: line 1: message size is '1786', must be an integer from 0 to 1785"},
        {"SameIdentifier",
         "BO_ 1 A: 8 X\nBO_ 1 B: 8 X",
         "v.dbc: line 2: message B: another has the identifier 1, must be unique"},
        {"SameName", "BO_ 1 A: 8 X\nBO_ 2 A: 8 X", "v.dbc: line 2: message A is there twice"},
        {"SameSignal",
         InMessage("SG_ FR : 8|8@1+ (1,0) [0|0] \"\" X"),
         "v.dbc: line 3: signal WHEELS.FR is there twice"},
        {"Outside",
         InMessage("SG_ FL : 60|8@1+ (1,0) [0|0] \"\" X"),
         "v.dbc: line 3: signal WHEELS.FL: 8 bits from bit 60, must lie within the 8 bytes"},
        {"ByteOrderMark",
         InMessage("SG_ FL : 8|8@2+ (1,0) [0|0] \"\" X"),
         "v.dbc: line 3: byte order (1 little endian, 0 big endian) is '2', must be '0'"},
        {"NoSign",
         InMessage("SG_ FL : 8|8@1 (1,0) [0|0] \"\" X"),
         "v.dbc: line 3: sign (+ unsigned, - signed) is '(', must be '+'"},
        {"NotANumber",
         InMessage("SG_ FL : 8|8@1+ (nan,0) [0|0] \"\" X"),
         "v.dbc: line 3: factor is 'nan', must be a finite number"},
        {"ZeroFactor",
         InMessage("SG_ FL : 8|8@1+ (0,0) [0|0] \"\" X"),
         "v.dbc: line 3: factor of signal FL is 0, must not be"},
        {"NoUnit",
         InMessage("SG_ FL : 8|8@1+ (1,0) [0|0] XXX"),
         "v.dbc: line 3: unit is 'X', must be text in double quotes on one line"},
        {"Multiplexing",
         InMessage("SG_ FL x1 : 8|8@1+ (1,0) [0|0] \"\" X"),
         "v.dbc: line 3: multiplexing of signal FL is 'x1', must be M or m and a number"},
        {"MultiplexorMissing",
         InMessage("SG_MUL_VAL_ 170 FR MODE 1-1;"),
         "v.dbc: line 3: multiplexor of signal WHEELS.FR is MODE, must be a signal with M there"},
        {"RangeBackwards",
         InMessage("SG_ MODE M : 8|8@1+ (1,0) [0|0] \"\" X\nSG_MUL_VAL_ 170 FR MODE 1-5, 3-2;"),
         "v.dbc: line 4: range of signal FR is 3-2, must not go backwards"},
        {"RangeTooWide",
         InMessage("SG_ MODE M : 8|8@1+ (1,0) [0|0] \"\" X\n"
                   "SG_MUL_VAL_ 170 FR MODE 0-18446744073709551616;"),
         "v.dbc: line 4: last value of a range is '18446744073709551616', must be an integer of at "
         "most 64 bits without a sign"},
        {"Circle",
         "BO_ 1 A: 8 X\n SG_ B m1M : 0|8@1+ (1,0) [0|0] \"\" X\n"
         " SG_ C m1M : 8|8@1+ (1,0) [0|0] \"\" X\n"
         "SG_MUL_VAL_ 1 B C 1-1;\nSG_MUL_VAL_ 1 C B 1-1;\n",
         "v.dbc: signal A.B: its multiplexors go round in a circle"},
        {"CircleOfOne",
         "BO_ 1 A: 8 X\n SG_ B m1M : 0|8@1+ (1,0) [0|0] \"\" X\nSG_MUL_VAL_ 1 B B 1-1;\n",
         "v.dbc: signal A.B: its multiplexors go round in a circle"},
        {"ValueName",
         InMessage("VAL_ 170 FR 1 moving;"),
         "v.dbc: line 3: name of a value is 'm', must be text in double quotes on one line"},
        {"FloatLength",
         InMessage("SIG_VALTYPE_ 170 FR : 1;"),
         "v.dbc: line 3: floating-point signal WHEELS.FR has 8 bits, must have 32"},
    }),
    [](const auto& instance) { return instance.param.name; });

TEST(DbcFileTest, ReadsCommentsValueNamesAndCycleTimes) {
  const auto dbc = DbcFile::Parse(
      "\xEF\xBB\xBFVERSION \"\"\r\n"
      "VAL_TABLE_ Gear -1 \"reverse\" 0 \"neutral\" ;\r\n"
      "BO_ 1 A: 8 X\r\n"
      " SG_ GEAR : 0|4@1- (1,0) [0|0] \"\" X\r\n"
      " SG_ WIDE : 8|56@1+ (1,0) [0|0] \"\" X\r\n"
      "CM_ \"of the file\";\r\n"
      "CM_ BU_ X \"of a node\";\r\n"
      "CM_ BO_ 1 \"two\r\nlines; and \\\"quotes\\\"\";\r\n"
      "CM_ SG_ 1 GEAR \"of a signal\";\r\n"
      "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\r\n"
      "BA_ \"GenMsgCycleTime\" BO_ 1 20;\r\n"
      "VAL_ 1 GEAR Gear;\r\n"
      "VAL_ 1 WIDE 0 \"none\" 18446744073709551615 \"all\" ;\r\n"
      "VAL_ Environment 0 \"x\" ;\r\n"
      "VAL_ 2 OTHER 0 \"x\" ;\r\n",
      "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  const DbcMessage& message = dbc->messages().front();
  EXPECT_EQ(message.comment, "two\nlines; and \"quotes\"");
  EXPECT_EQ(message.cycle_time_s, 0.02);
  EXPECT_EQ(message.FindSignal("GEAR")->comment, "of a signal");
  EXPECT_EQ(message.FindSignal("GEAR")->value_names.at(-1), "reverse");
  EXPECT_EQ(message.FindSignal("WIDE")->value_names.at(-1), "all");
  EXPECT_EQ(RawInteger(*message.FindSignal("GEAR"), 0xF), -1);
}

/// PAGE selects SUBPAGE (1 to 3) and PLAIN (0), SUBPAGE selects DEEP (2, 7 to 9).
constexpr const char* kExtended =
    "BO_ 1 A: 8 X\n"
    " SG_ PAGE M : 0|8@1+ (1,0) [0|0] \"\" X\n"
    " SG_ PLAIN m0 : 8|8@1+ (1,0) [0|0] \"\" X\n"
    " SG_ SUBPAGE m1M : 8|8@1+ (1,0) [0|0] \"\" X\n"
    " SG_ DEEP m2 : 16|8@1+ (1,0) [0|0] \"\" X\n"
    " SG_ ALWAYS : 24|8@1+ (1,0) [0|0] \"\" X\n"
    "SG_MUL_VAL_ 1 PLAIN PAGE 0-0;\n"
    "SG_MUL_VAL_ 1 SUBPAGE PAGE 1-3;\n"
    "SG_MUL_VAL_ 1 DEEP SUBPAGE 2-2, 7-9;\n";

TEST(DbcFileTest, FollowsExtendedMultiplexing) {
  const auto dbc = DbcFile::Parse(kExtended, "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  const DbcMessage& message = dbc->messages().front();
  for (unsigned page = 0; page < 6; ++page) {
    for (unsigned subpage = 0; subpage < 12; ++subpage) {
      const std::array<std::uint8_t, 8> payload = {static_cast<std::uint8_t>(page),
                                                   static_cast<std::uint8_t>(subpage)};
      const bool has_subpage = page >= 1 && page <= 3;
      const bool has_deep = has_subpage && (subpage == 2 || (subpage >= 7 && subpage <= 9));
      EXPECT_TRUE(IsPresent(message, *message.FindSignal("ALWAYS"), payload));
      EXPECT_EQ(IsPresent(message, *message.FindSignal("PLAIN"), payload), page == 0);
      EXPECT_EQ(IsPresent(message, *message.FindSignal("SUBPAGE"), payload), has_subpage);
      EXPECT_EQ(IsPresent(message, *message.FindSignal("DEEP"), payload), has_deep)
          << page << " " << subpage;
    }
  }
  EXPECT_TRUE(dbc->FindSignal("A.DEEP"));
}

TEST(DbcFileTest, ComparesMultiplexorsOf64Bits) {
  const auto dbc = DbcFile::Parse(
      "BO_ 1 A: 12 X\n"
      " SG_ WIDE M : 0|64@1+ (1,0) [0|0] \"\" X\n"
      " SG_ LAST m5 : 64|8@1+ (1,0) [0|0] \"\" X\n"
      "SG_MUL_VAL_ 1 LAST WIDE 18446744073709551615-18446744073709551615;\n",
      "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  const DbcMessage& message = dbc->messages().front();
  std::array<std::uint8_t, 12> payload{};
  payload.fill(0xFF);
  EXPECT_TRUE(IsPresent(message, *message.FindSignal("LAST"), payload));
  EXPECT_EQ(DecodeSignal(*message.FindSignal("WIDE"), payload), 18446744073709551616.0);
  payload[7] = 0x7F;
  EXPECT_FALSE(IsPresent(message, *message.FindSignal("LAST"), payload));
}

/// Behind `m1M` without SG_MUL_VAL_ the numbers may be of either multiplexor.
TEST(DbcFileTest, DoesNotGuessWhichMultiplexorIsMeant) {
  const auto dbc = DbcFile::Parse(
      "BO_ 1 A: 8 X\n"
      " SG_ OUTER M : 0|4@1+ (1,0) [0|0] \"\" X\n"
      " SG_ B m1 : 8|4@1+ (1,0) [0|0] \"\" X\n"
      "BO_ 2 C: 8 X\n"
      " SG_ OUTER M : 0|4@1+ (1,0) [0|0] \"\" X\n"
      " SG_ INNER m1M : 4|4@1+ (1,0) [0|0] \"\" X\n"
      " SG_ D m1 : 8|4@1+ (1,0) [0|0] \"\" X\n",
      "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  EXPECT_TRUE(dbc->FindSignal("A.B"));
  EXPECT_EQ(dbc->FindSignal("C.D").error().message,
            "v.dbc: signal 'C.D' depends on several multiplexors, or none: SG_MUL_VAL_ must say on "
            "which");
  const DbcMessage& message = dbc->messages()[1];
  EXPECT_FALSE(IsPresent(message, *message.FindSignal("D"), std::array<std::uint8_t, 8>{0x11}));
}

TEST(DbcFileTest, KeepsLongMessagesOfJ1939AndRefusesTheirSignals) {
  const auto dbc = DbcFile::Parse(
      "BO_ 2566844926 LONG: 100 X\n SG_ B : 792|8@1+ (1,0) [0|0] \"\" X\n"
      "BO_ 1 FD: 64 X\n SG_ B : 504|8@1+ (1,0) [0|0] \"\" X\n",
      "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  EXPECT_TRUE(dbc->FindSignal("FD.B"));
  EXPECT_EQ(
      dbc->FindSignal("LONG.B").error().message,
      "v.dbc: signal 'LONG.B' is in a message of 100 bytes, must be in one of up to 64, which a "
      "frame can hold");
  EXPECT_NE(dbc->FindMessage(CanId{.value = 1}), nullptr);
  EXPECT_EQ(dbc->FindMessage(CanId{.value = 1, .extended = true}), nullptr);
  EXPECT_EQ(dbc->FindMessage("FDD").error().message,
            "v.dbc: has no message 'FDD', nearest are FD, LONG");
}

/// Whatever a file says is read without a fault, and what is read can be decoded.
void ExpectUsable(const Result<DbcFile>& dbc) {
  if (!dbc) {
    EXPECT_THAT(dbc.error().message, HasSubstr("v.dbc: "));
    return;
  }
  const std::vector<std::uint8_t> payload(2048, 0x5A);
  for (const DbcMessage& message : dbc->messages()) {
    const auto bytes = std::span(payload).first(static_cast<std::size_t>(message.size));
    for (const DbcSignal& signal : message.signals) {
      EXPECT_TRUE(DecodeBits(signal, bytes));
      IsPresent(message, signal, bytes);
      const auto found = dbc->FindSignal(message.name + "." + signal.name);
      EXPECT_TRUE(!found || found->signal == &signal);
    }
  }
}

TEST(DbcFileTest, SurvivesBeingCutAnywhere) {
  for (const std::string& text : {std::string(kVehicle), std::string(kExtended)}) {
    int accepted = 0;
    for (std::size_t length = 0; length <= text.size(); ++length) {
      const auto dbc = DbcFile::Parse(text.substr(0, length), "v.dbc");
      ExpectUsable(dbc);
      accepted += dbc ? 1 : 0;
    }
    EXPECT_GT(accepted, 20);
  }
}

TEST(DbcFileTest, SurvivesMutations) {
  TestRandom random(4);
  const std::string text =
      std::string(kVehicle) + "BA_ \"GenMsgCycleTime\" BO_ 170 12;\n" + std::string(kExtended);
  int accepted = 0;
  for (int i = 0; i < 5000; ++i) {
    const auto dbc = DbcFile::Parse(MutateBytes(text, random), "v.dbc");
    ExpectUsable(dbc);
    accepted += dbc ? 1 : 0;
  }
  EXPECT_GT(accepted, 500);
}

TEST(DbcFileTest, SurvivesHostileBytes) {
  std::mt19937 engine(1);
  const std::string vehicle = kVehicle;
  int accepted = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = vehicle;
    for (std::uint32_t k = engine() % 8; k > 0; --k) {
      const std::size_t at = engine() % text.size();
      switch (engine() % 3) {
        case 0:
          text[at] = static_cast<char>(engine() % 256);
          break;
        case 1:
          text.erase(at, engine() % 20);
          break;
        default:
          text.insert(at, text.substr(engine() % text.size(), engine() % 20));
      }
    }
    const auto dbc = DbcFile::Parse(text, "v.dbc");
    if (!dbc) {
      EXPECT_THAT(dbc.error().message, HasSubstr("v.dbc: "));
      continue;
    }
    ++accepted;
    const std::array<std::uint8_t, 64> payload{};
    for (const DbcMessage& message : dbc->messages()) {
      for (const DbcSignal& signal : message.signals) {
        EXPECT_TRUE(
            DecodeBits(signal, std::span(payload).first(static_cast<std::size_t>(message.size))));
        IsPresent(message, signal, payload);
      }
    }
  }
  EXPECT_GT(accepted, 500);  // those that hit a comment or a name
}

}  // namespace
}  // namespace relocd
