#include "core/file.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/unique_fd.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class FileTest : public testing::Test {
 protected:
  TemporaryFolder temporary_;
  std::string folder_ = temporary_.path();
};

TEST_F(FileTest, ReadsBackWhatWasWritten) {
  const std::string bytes("a\0b\xFF\n", 5);
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/state", bytes));
  EXPECT_EQ(ReadFile(folder_ + "/state").value(), bytes);
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/state", "new"));
  EXPECT_EQ(ReadFile(folder_ + "/state").value(), "new");
}

TEST_F(FileTest, ReadsInSteps) {
  ASSERT_TRUE(WriteFile(folder_ + "/state", std::string(200'000, 'x')));
  int steps = 0;
  EXPECT_EQ(ReadFile(folder_ + "/state", [&steps] { ++steps; })->size(), 200'000U);
  EXPECT_EQ(steps, 4);
}

TEST_F(FileTest, LeavesNothingBesideTheFile) {
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/state", "x"));
  const auto files = std::filesystem::directory_iterator(folder_);
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST_F(FileTest, KeepsTheOldFileWhenTheNewOneCannotTakeItsPlace) {
  std::filesystem::create_directory(folder_ + "/state");  // a folder cannot be renamed over
  std::filesystem::create_directory(folder_ + "/state/inside");
  const auto ok = WriteFileAtomically(folder_ + "/state", "x");
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().message, HasSubstr("/state"));
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/state/inside"));
  const auto files = std::filesystem::directory_iterator(folder_);
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST_F(FileTest, WritesIntoWhatIsNoFile) {
  const std::string pipe = folder_ + "/pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), S_IRUSR | S_IWUSR), 0);
  const UniqueFd reader(::open(pipe.c_str(), O_RDWR | O_CLOEXEC));
  ASSERT_TRUE(WriteFileAtomically(pipe, "x"));
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST_F(FileTest, LeavesALinkALink) {
  ASSERT_TRUE(WriteFile(folder_ + "/real", "old"));
  std::filesystem::create_symlink("real", folder_ + "/link");
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/link", "new"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ + "/link"));
  EXPECT_EQ(ReadFile(folder_ + "/real").value(), "new");
}

TEST_F(FileTest, WritesOverWhatWasThere) {
  ASSERT_TRUE(WriteFile(folder_ + "/image", "a long one"));
  ASSERT_TRUE(WriteFile(folder_ + "/image", "short"));
  EXPECT_EQ(ReadFile(folder_ + "/image").value(), "short");
}

TEST_F(FileTest, SaysThatTheDiskIsFull) {
  const auto ok = WriteFile("/dev/full", "x");
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().message, "writing /dev/full: No space left on device");
}

TEST_F(FileTest, NamesWhatItCannotOpen) {
  const auto missing = ReadFile(folder_ + "/none");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(missing.error().message, HasSubstr("/none: No such file or directory"));
}

}  // namespace
}  // namespace relocd
