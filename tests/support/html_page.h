#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/imgcodecs.hpp>

// What a test can say of a page of HTML that has its pictures in it.

namespace relocd {

/// A picture of one colour, 4 px high.
///
/// @param type  as `.png`.
inline std::string EncodedPicture(const char* type, int width) {
  std::vector<unsigned char> bytes;
  cv::imencode(type, cv::Mat(4, width, CV_8UC3, cv::Scalar(10, 200, 30)), bytes);
  return {bytes.begin(), bytes.end()};
}

inline bool IsVoid(std::string_view name) {
  for (const std::string_view other : {"!DOCTYPE", "meta", "img", "source", "br"}) {
    if (name == other) return true;
  }
  return false;
}

/// @return what is wrong with the nesting of the page's elements; empty when it is well-formed.
inline std::string ProblemOf(std::string_view html) {
  std::vector<std::string> open;
  std::size_t at = 0;
  while ((at = html.find('<', at)) != std::string_view::npos) {
    const std::size_t end = html.find('>', at);
    if (end == std::string_view::npos) return "a tag does not end";
    const std::string_view tag = html.substr(at + 1, end - at - 1);
    if (tag.find('<') != std::string_view::npos) return "a tag within a tag: " + std::string(tag);
    if (std::ranges::count(tag, '"') % 2 != 0) return "an open quote: " + std::string(tag);
    const bool is_end = tag.starts_with('/');
    const std::string name(tag.substr(is_end ? 1 : 0, tag.find(' ') - (is_end ? 1 : 0)));
    if (is_end) {
      if (open.empty() || open.back() != name) return "</" + name + "> ends nothing";
      open.pop_back();
    } else if (!IsVoid(name)) {
      open.push_back(name);
    }
    at = end;
    if (name == "style" && !is_end) at = html.find("</style>", end);
  }
  return open.empty() ? "" : "<" + open.back() + "> does not end";
}

inline std::vector<unsigned char> DecodeBase64(std::string_view text) {
  std::vector<unsigned char> bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const auto digit =
        std::string_view("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/")
            .find(c);
    if (digit == std::string_view::npos) break;
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<unsigned char>(bits >> static_cast<unsigned>(count) & 0xFFU));
  }
  return bytes;
}

/// The widths of all pictures in the page, 0 for one that cannot be decoded.
inline std::vector<int> WidthsOfPictures(std::string_view html) {
  constexpr std::string_view kBase64 = ";base64,";
  std::vector<int> widths;
  std::size_t at = 0;
  while ((at = html.find(kBase64, at)) != std::string_view::npos) {
    at += kBase64.size();
    const auto bytes = DecodeBase64(html.substr(at, html.find('"', at) - at));
    widths.push_back(bytes.empty() ? 0 : cv::imdecode(bytes, cv::IMREAD_COLOR).cols);
  }
  return widths;
}

}  // namespace relocd
