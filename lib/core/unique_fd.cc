#include "core/unique_fd.h"

#include <unistd.h>

namespace relocd {

UniqueFd::~UniqueFd() {
  if (valid()) ::close(fd_);
}

}  // namespace relocd
