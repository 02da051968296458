#pragma once

#include <string>
#include <string_view>

#include "core/progress.h"
#include "core/result.h"

namespace relocd {

/// `<doing>: <what errno says>`. Call it before anything else can change errno.
Error SystemError(ErrorKind kind, std::string_view doing);

/// The whole file. @return kUnavailable when it cannot be read.
Result<std::string> ReadFile(const std::string& path, const Progress& progress = Unwatched);

/// Creates the file or replaces its content, without waiting for the disk. A reader may see a part.
///
/// @return kUnavailable when it cannot be written whole.
Result<void> WriteFile(const std::string& path, std::string_view bytes);

/// Replaces the file by `bytes` such that a reader, also one after a power cut, sees the old or the
/// new content whole: writes beside it, syncs, renames, syncs the folder. A link to a file stays
/// one, to the new content. What is no file, as /dev/null or a pipe, is written to as it is: a
/// rename by root would put a file in the place of the device.
///
/// @return kUnavailable when it cannot be written; the old file is then still there.
Result<void> WriteFileAtomically(const std::string& path, std::string_view bytes);

}  // namespace relocd
