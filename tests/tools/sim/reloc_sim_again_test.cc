#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/dataset.h"
#include "camera/jpeg.h"
#include "core/file.h"
#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

/// Runs reloc-sim as a person would.
Ended RunTool(const std::string& arguments) {
  return RunProgram(RELOC_SIM " " + arguments);
}

class RelocSimAgainTest : public testing::Test {
 protected:
  RelocSimAgainTest() {
    std::string frames;
    std::string poses;
    for (int k = 0; k < 5; ++k) {
      frames += fmt::format("{}.jpg\n", k);
      poses += fmt::format("{} {} 0 3 -0.5 0.5 -0.5 0.5\n", 0.5 * k, 2 * k);
    }
    folder_.Write("drive/frames.txt", frames);
    folder_.Write("drive/poses_tum.txt", poses);
    folder_.Write("drive/intrinsics.txt", "32 32 31.5 23.5 64 48\n");
  }

  [[nodiscard]] Ended Again(const std::string& options) const {
    return RunTool(
        fmt::format("again --drive {0}/drive --out {0}/places {1}", folder_.path(), options));
  }

  TemporaryFolder folder_;
};

TEST_F(RelocSimAgainTest, TakesPicturesFromTheDrivesPlacesWithItsCamera) {
  const Ended ended = Again("--count 2 --samples 1 --session overcast");
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  const auto drive = ReadDataset(folder_.path() + "/drive");
  const auto places = ReadDataset(folder_.path() + "/places");
  ASSERT_TRUE(drive);
  ASSERT_TRUE(places) << places.error().message;
  ASSERT_EQ(places->frames.size(), 2U);
  for (std::size_t i = 0; i < places->frames.size(); ++i) {
    const DatasetFrame& original = drive->frames[2 * i + 1];
    EXPECT_EQ(places->frames[i].time_ns, original.time_ns);
    EXPECT_TRUE(places->frames[i].X_WC.translation().isApprox(original.X_WC.translation(), 1e-9));
    const auto jpeg = ReadFile(places->frames[i].image_path);
    ASSERT_TRUE(jpeg);
    const auto image =
        DecodeJpegToGray({reinterpret_cast<const std::uint8_t*>(jpeg->data()), jpeg->size()});
    ASSERT_TRUE(image);
    EXPECT_EQ(image->width, 64);
    EXPECT_EQ(image->height, 48);
  }
}

TEST_F(RelocSimAgainTest, AnUnknownSessionIsAWrongInput) {
  const Ended ended = Again("--session nonn");
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output, HasSubstr("noon"));
}

}  // namespace
}  // namespace relocd
