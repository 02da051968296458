#include "smootherd/saved_state.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

SavedState MakeState() {
  SavedState state;
  state.boot_id = "7f3c";
  state.time = FromNanoseconds(123456789012345);
  state.odometry_run_id = 9876543210;
  state.map_id = "0123456789abcdef";
  state.X_WB = Pose2(1.0 / 3.0, -2.0 / 7.0, 3.1);
  state.X_OB = Pose2(100.1, 1e-9, -3.1);
  state.covariance << 0.1, 0.01, 0.0, 0.01, 0.2, 0.001, 0.0, 0.001, 0.003;
  return state;
}

std::string Replaced(const std::string& from, const std::string& to) {
  std::string text = FormatSavedState(MakeState());
  return text.replace(text.find(from), from.size(), to);
}

TEST(SavedStateTest, ReadsBackEveryBit) {
  const SavedState state = MakeState();
  const auto read = ParseSavedState(FormatSavedState(state), "state");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->boot_id, state.boot_id);
  EXPECT_EQ(read->time, state.time);
  EXPECT_EQ(read->odometry_run_id, state.odometry_run_id);
  EXPECT_EQ(read->map_id, state.map_id);
  EXPECT_EQ(read->X_WB.x(), state.X_WB.x());
  EXPECT_EQ(read->X_WB.yaw(), state.X_WB.yaw());
  EXPECT_EQ(read->X_OB.y(), state.X_OB.y());
  EXPECT_EQ(read->covariance, state.covariance);
}

TEST(SavedStateTest, ReadsAStateWithoutMap) {
  SavedState state = MakeState();
  state.map_id.clear();
  const auto read = ParseSavedState(FormatSavedState(state), "state");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->map_id, "");
}

struct BadText {
  std::string name;
  std::string text;
  std::string message;
};

class BadSavedStateTest : public testing::TestWithParam<BadText> {};

TEST_P(BadSavedStateTest, IsRefusedWithLineAndWhatIsAllowed) {
  const auto read = ParseSavedState(GetParam().text, "dir/state");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(read.error().message, testing::HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Texts,
    BadSavedStateTest,
    testing::Values(
        BadText{"Empty", "", "dir/state: has no format, must have each of format, boot_id"},
        BadText{"Cut",
                FormatSavedState(MakeState()).substr(0, FormatSavedState(MakeState()).find("X_WB")),
                "dir/state: has no X_WB, must have each of format"},
        BadText{"OtherFormat",
                Replaced("smootherd 1", "smootherd 2"),
                "line 1: format is 'relocd smootherd 2', must be 'relocd smootherd 1'"},
        BadText{"UnknownKey", Replaced("mono_ns", "mono"), "line 3: is 'mono: 123456789012345'"},
        BadText{"BeforeTheBoot",
                Replaced("mono_ns: 123456789012345", "mono_ns: -9223372036854775808"),
                "line 3: mono_ns is -9223372036854775808, must be >= 0"},
        BadText{"Twice", Replaced("boot_id: 7f3c", "boot_id: 7f3c\nboot_id: 1"), "given twice"},
        BadText{"NotFinite",
                Replaced("X_OB: 100.1", "X_OB: nan"),
                "line 7: X_OB is 'nan 1e-09 -3.1', must be 3 finite numbers"},
        BadText{"NoCovariance",
                Replaced("covariance: 0.1", "covariance: -0.1"),
                "must be symmetric and positive definite"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace relocd
