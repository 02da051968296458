#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "support/random.h"

namespace relocd {

/// `bytes` with one to four things wrong, as files from a failing disk or a hostile hand have them:
/// bytes changed, put in, taken out, swapped for digits or extremes, parts repeated, the end gone.
inline std::string MutateBytes(std::string bytes, TestRandom& random) {
  const int edits = random.Integer(1, 4);
  for (int i = 0; i < edits && !bytes.empty(); ++i) {
    const auto last = static_cast<int>(bytes.size()) - 1;
    const auto at = static_cast<std::size_t>(random.Integer(0, last));
    const auto length =
        std::min(static_cast<std::size_t>(random.Integer(1, 16)), bytes.size() - at);
    switch (random.Integer(0, 6)) {
      case 0:
        bytes[at] = static_cast<char>(random.Integer(0, 255));
        break;
      case 1:
        bytes.insert(at, 1, static_cast<char>(random.Integer(0, 255)));
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 4:
        bytes[at] = static_cast<char>('0' + random.Integer(0, 9));
        break;
      case 5:
        bytes[at] = random.Integer(0, 1) == 0 ? '\xff' : '\0';
        break;
      default:
        if (random.Integer(0, 9) == 0) bytes.resize(at);
        break;
    }
  }
  return bytes;
}

}  // namespace relocd
