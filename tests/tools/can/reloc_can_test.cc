#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/csv.h"
#include "core/file.h"
#include "support/run_program.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr const char* kDbc =
    "BO_ 416 WHEELS: 4 X\n"
    " SG_ PAGE M : 0|4@1+ (1,0) [0|0] \"\" X\n"
    " SG_ SPEED m0 : 8|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ GEAR m1 : 8|8@1+ (1,0) [0|0] \"\" X\n"
    " SG_ SUM : 24|8@1+ (1,0) [0|0] \"\" X\n"
    "BO_ 417 OTHER: 1 X\n"
    " SG_ VALUE : 0|8@1+ (1,0) [0|0] \"\" X\n"
    "VAL_ 416 GEAR 1 \"first, low\" ;\n";

/// The last frame's checksum is wrong.
constexpr const char* kLog =
    "(1.000000) can0 1A0#009CFF63\n"
    "(1.100000) can0 1A0#01010000\n"
    "(1.100000) can1 1A0#00000000\n"
    "(1.200000) can0 1A0#00640065\n"
    "(1.200000) can0 123#00\n";

class RelocCanTest : public testing::Test {
 protected:
  Ended Run(const std::string& arguments) const {
    return RunProgram(fmt::format("{} decode --can {} {}", RELOC_CAN, log_, arguments));
  }
  std::string Decode(const std::string& arguments) const {
    const Ended ended =
        Run(fmt::format("--dbc {} --out {}/out.csv {}", dbc_, folder_.path(), arguments));
    EXPECT_EQ(ended.exit_code, 0) << ended.output;
    return ReadFile(folder_.path() + "/out.csv").value();
  }

  TemporaryFolder folder_;
  std::string dbc_ = folder_.Write("v.dbc", kDbc);
  std::string log_ = folder_.Write("can.log", kLog);
};

TEST_F(RelocCanTest, WritesARowForEachValueThatIsThere) {
  EXPECT_EQ(Decode("--interface can0 --signal WHEELS.SPEED --signal WHEELS.GEAR"),
            "time_ns,message,signal,value,unit,name,validity\n"
            "1000000000,WHEELS,SPEED,-1,m/s,,valid\n"
            "1100000000,WHEELS,GEAR,1,,\"first, low\",valid\n"
            "1200000000,WHEELS,SPEED,1,m/s,,valid\n");
}

TEST_F(RelocCanTest, WritesARowForEachFrame) {
  EXPECT_EQ(Decode("--wide --message WHEELS"),
            "time_ns,validity,PAGE,SPEED,GEAR,SUM\n"
            "1000000000,valid,0,-1,,99\n"
            "1100000000,valid,1,,1,0\n"
            "1100000000,valid,0,0,,0\n"
            "1200000000,valid,0,1,,101\n");
}

TEST_F(RelocCanTest, NamesFramesThatARuleRefusesAndKeepsThemOutOfTheRanges) {
  const std::string config = folder_.Write("v.yaml",
                                           "can:\n  dbc_file: v.dbc\n  messages:\n    WHEELS: "
                                           "{checksum: SUM, checksum_rule: xor8}\n");
  const Ended ended =
      Run(fmt::format("--config {} --interface can0 --signal WHEELS.SPEED --out {}/"
                      "out.csv",
                      config,
                      folder_.path()));
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("bad checksums 1"));
  EXPECT_THAT(ended.output, HasSubstr("-1 min             -1 mean             -1 max"));
  EXPECT_THAT(ReadFile(folder_.path() + "/out.csv").value(),
              HasSubstr("1200000000,WHEELS,SPEED,1,m/s,,bad_checksum\n"));
}

TEST_F(RelocCanTest, WritesIntegersOf64BitsDigitByDigit) {
  dbc_ = folder_.Write("v.dbc", "BO_ 418 WIDE: 8 X\n SG_ COUNT : 0|64@1+ (1,0) [0|0] \"\" X\n");
  log_ = folder_.Write("can.log",
                       "(1.0) can0 1A2#FEFFFFFFFFFFFFFF\n(1.1) can0 1A2#FFFFFFFFFFFFFFFF\n");
  EXPECT_THAT(Decode(""), HasSubstr("1000000000,WIDE,COUNT,18446744073709551614,,,valid\n"));
  EXPECT_THAT(Decode("--wide"), HasSubstr("1100000000,valid,18446744073709551615\n"));
  const std::string output = Run("--dbc " + dbc_).output;
  EXPECT_THAT(output, HasSubstr("18446744073709551614 min"));
  EXPECT_THAT(output, HasSubstr("18446744073709551615 max 18446744073709551615 last"));
}

TEST_F(RelocCanTest, NamesAndCountsValuesThatAreNotFinite) {
  dbc_ = folder_.Write("v.dbc",
                       "BO_ 419 REAL: 4 X\n SG_ TORQUE : 0|32@1- (1,0) [0|0] \"\" X\n"
                       "SIG_VALTYPE_ 419 TORQUE : 1;\n");
  log_ = folder_.Write("can.log",
                       "(1.0) can0 1A3#0000C07F\n(1.1) can0 1A3#0000803F\n(1.2) can0 1A3#R\n");
  EXPECT_THAT(Decode(""),
              HasSubstr("1000000000,REAL,TORQUE,nan,,,not_finite\n"
                        "1100000000,REAL,TORQUE,1,,,valid\n"));
  EXPECT_THAT(Decode("--wide"), HasSubstr("1000000000,valid,nan\n"));
  const std::string output = Run("--dbc " + dbc_).output;
  EXPECT_THAT(output, HasSubstr("1 last ; not finite 1\n"));
  EXPECT_THAT(output, HasSubstr("3 frames, 0 of other messages, 1 remote or error frames\n"));
}

TEST_F(RelocCanTest, SaysThatTheLastLineIsCutOff) {
  log_ = folder_.Write("can.log", "(1.0) can0 1A0#009CFF63\n(1.1) can0 1A0#0");
  const Ended ended = Run("--dbc " + dbc_);
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_THAT(ended.output,
              HasSubstr("reloc can decode: " + log_ + ": line 2 is cut off and left out\n"));
  EXPECT_THAT(ended.output, HasSubstr("1 frames, 0 of other messages"));
}

TEST_F(RelocCanTest, SaysWhatIsMissing) {
  EXPECT_EQ(Run("--set can.interface=can1 --dbc " + dbc_).exit_code, 2);
  EXPECT_THAT(Run("").output, HasSubstr("no DBC file, must be given by --dbc or --config"));
  const Ended unknown = Run("--dbc " + dbc_ + " --message WHEEL");
  EXPECT_EQ(unknown.exit_code, 78);
  EXPECT_THAT(unknown.output, HasSubstr("has no message 'WHEEL', nearest are WHEELS, OTHER"));
  EXPECT_THAT(Run("--dbc " + dbc_ + " --message OTHER").output,
              HasSubstr("has none of the 1 messages that are asked for in 5 frames"));
  EXPECT_THAT(Run("--wide --dbc " + dbc_).output, HasSubstr("--wide with 2 messages"));
}

TEST_F(RelocCanTest, DecodesARealCarAsTheReferenceDid) {
  const std::string data = SharedData("comma_can");
  if (data.empty()) GTEST_SKIP() << SharedDataReason("comma_can");
  log_ = data + "/can0_vehicle_bus.log";
  dbc_ = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/toyota_rav4.dbc";
  folder_.Write("decoded.csv", Decode("--wide --message STEER_ANGLE_SENSOR"));
  const auto decoded = CsvTable::Read(folder_.path() + "/decoded.csv").value();
  const auto reference = CsvTable::Read(data + "/steering_angle.csv").value();
  ASSERT_EQ(decoded.row_count(), reference.row_count());
  const auto angle = decoded.FindColumn("STEER_ANGLE").value();
  const auto fraction = decoded.FindColumn("STEER_FRACTION").value();
  for (std::size_t row = 0; row < decoded.row_count(); ++row) {
    const double degrees =
        decoded.Double(row, angle).value() + decoded.Double(row, fraction).value();
    ASSERT_NEAR(degrees, reference.Double(row, 1).value(), 1e-9) << decoded.Where(row);
  }
}

}  // namespace
}  // namespace relocd
