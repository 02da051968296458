#include "can/dbc.h"

#include <array>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/signal.h"

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
  ASSERT_NE(encoders.multiplexor(), nullptr);
  EXPECT_EQ(encoders.multiplexor()->name, "MODE");
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
         "v.dbc: the file ends within a section, must end it with ';'"},
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
         "BO_ 1 A: 65 X",
         "v.dbc: line 1: message size is '65', must be an integer from 0 to 64"},
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
        {"FloatLength",
         InMessage("SIG_VALTYPE_ 170 FR : 1;"),
         "v.dbc: line 3: floating-point signal WHEELS.FR has 8 bits, must have 32"},
    }),
    [](const auto& instance) { return instance.param.name; });

TEST(DbcFileTest, RefusesASignalThatIsMultiplexedTwice) {
  const auto dbc = DbcFile::Parse(
      "BO_ 1 A: 8 X\n"
      " SG_ OUTER M : 0|4@1+ (1,0) [0|0] \"\" X\n"
      " SG_ B m1 : 8|4@1+ (1,0) [0|0] \"\" X\n"
      "BO_ 2 C: 8 X\n"
      " SG_ INNER m1M : 4|4@1+ (1,0) [0|0] \"\" X\n"
      " SG_ D m1 : 8|4@1+ (1,0) [0|0] \"\" X\n",
      "v.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  EXPECT_TRUE(dbc->FindSignal("A.B"));
  EXPECT_THAT(dbc->FindSignal("C.D").error().message, HasSubstr("multiplexed twice"));
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
