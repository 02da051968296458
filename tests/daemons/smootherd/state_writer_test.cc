#include "smootherd/state_writer.h"

#include <filesystem>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "core/file.h"

namespace relocd {
namespace {

TEST(StateWriterTest, HasWrittenTheNewestTextWhenItEnds) {
  const std::string folder = testing::TempDir() + "relocd_state_writer_test";
  const std::string path = folder + "/state";
  {
    StateWriter writer(path);
    for (int i = 0; i < 100; ++i)
      writer.Write(std::to_string(i));
  }
  EXPECT_EQ(*ReadFile(path), "99");
  std::filesystem::remove_all(folder);
}

TEST(StateWriterTest, TellsWhyItCannotWrite) {
  std::optional<StateWriter> writer("/proc/no_such_folder/state");
  writer->Write("text");
  while (writer->last_result().has_value()) {
  }
  EXPECT_NE(writer->last_result().error().message.find("/proc/no_such_folder/state"),
            std::string::npos);
}

}  // namespace
}  // namespace relocd
