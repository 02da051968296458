#include "rendering/read_image.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace relocd {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ReadRgbaImage, TellsFormatsByTheirFirstBytes) {
  const TemporaryFolder folder;
  std::string sgi(512, '\0');
  sgi.replace(0, 12, std::string_view("\x01\xda\0\1\0\2\0\1\0\1\0\1", 12));
  const auto image = ReadRgbaImage(folder.Write("gray.png", sgi + "\x7f"));
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_THAT(image->pixels, ::testing::ElementsAre(127, 127, 127, 255));
}

TEST(ReadRgbaImage, NamesTheFileInErrors) {
  const TemporaryFolder folder;
  const std::string other = folder.Write("a.gif", "GIF89a");
  EXPECT_EQ(ReadRgbaImage(other).error().message, other + ": is neither a PNG nor an SGI image");
  const std::string png = folder.Write("a.png", "\x89PNG\r\n\x1a\n");
  EXPECT_THAT(ReadRgbaImage(png).error().message, StartsWith(png + ": PNG image: "));
  const std::string sgi = folder.Write("a.rgb", "\x01\xda");
  EXPECT_THAT(ReadRgbaImage(sgi).error().message, StartsWith(sgi + ": SGI image: has 2 bytes"));
  const auto none = ReadRgbaImage(folder.path() + "/none.png");
  EXPECT_EQ(none.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(none.error().message, AllOf(HasSubstr("none.png"), HasSubstr("No such file")));
}

}  // namespace
}  // namespace relocd
