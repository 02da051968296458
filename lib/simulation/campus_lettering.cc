#include "simulation/campus_lettering.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace relocd {
namespace {

// Strokes of a letter: each pair of digits is a point, its column in [0, 4] and its row in [0, 6]
// from above; a space begins a new stroke.
constexpr std::array<std::string_view, 26> kLetters{
    "062046 1434",                     // A
    "0006 003041423303 333344453606",  // B
    "4130100105163645",                // C
    "000626444220 0020",               // D
    "40000646 0333",                   // E
    "400006 0333",                     // F
    "413010010516364543 4323",         // G
    "0006 4046 0343",                  // H
    "2026 1030 1636",                  // I
    "404536160504",                    // J
    "0006 4003 0346",                  // K
    "000646",                          // L
    "0600234046",                      // M
    "06004640",                        // N
    "103041453616050110",              // O
    "060030414233 0333",               // P
    "103041453616050110 2446",         // Q
    "06003041423303 2346",             // R
    "413010010213334445361605",        // S
    "0040 2026",                       // T
    "000516364540",                    // U
    "002640",                          // V
    "0016233640",                      // W
    "0046 4006",                       // X
    "0023 4023 2326",                  // Y
    "00400646",                        // Z
};
constexpr std::array<std::string_view, 10> kDigits{
    "103041453616050110 4105",              // 0
    "012026 0646",                          // 1
    "0110304142060646",                     // 2
    "011030414233 2333 33444536 361605",    // 3
    "36300444",                             // 4
    "400003334445361605",                   // 5
    "3010010516364544330302",               // 6
    "004016",                               // 7
    "103041423313020110 1304051636454433",  // 8
    "4130100102134342 413616",              // 9
};

constexpr float kColumns = 4.0F;
constexpr float kRows = 6.0F;
constexpr float kGap = 1.9F;  // Between letters, in columns.

std::string_view StrokesOf(char letter) {
  if (letter >= 'A' && letter <= 'Z') return kLetters.at(static_cast<std::size_t>(letter - 'A'));
  if (letter >= '0' && letter <= '9') return kDigits.at(static_cast<std::size_t>(letter - '0'));
  switch (letter) {
    case '&':
      return "461110203104051625 2543";
    case '.':
      return "1616";
    case '-':
      return "1333";
    case '\'':
      return "2021";
    default:
      return "";
  }
}

float UnitOf(const Lettering& lettering) {
  return lettering.height / kRows;
}

}  // namespace

float TextWidth(std::string_view text, const Lettering& lettering) {
  const float letters = static_cast<float>(text.size());
  return UnitOf(lettering) * std::max(letters * (kColumns + kGap) - kGap, 0.0F);
}

void DrawText(std::string_view text,
              const Eigen::Vector2f& lower_left,
              const Lettering& lettering,
              Canvas& canvas) {
  const float unit = UnitOf(lettering);
  Eigen::Vector2f origin = lower_left;
  for (const char letter : text) {
    const std::string_view strokes = StrokesOf(letter);
    const auto point = [&](std::size_t i) -> Eigen::Vector2f {
      const float column = static_cast<float>(strokes[i] - '0');
      const float up = kRows - static_cast<float>(strokes[i + 1] - '0');
      return origin + unit * Eigen::Vector2f(column + lettering.slant * up, -up);
    };
    for (std::size_t i = 0; i + 3 < strokes.size(); i += 2) {
      if (strokes[i] == ' ') ++i;
      if (i + 3 >= strokes.size() || strokes[i + 2] == ' ') continue;
      canvas.DrawStroke(point(i), point(i + 2), lettering.stroke, lettering.paint);
    }
    origin.x() += unit * (kColumns + kGap);
  }
}

void DrawTextWithin(std::string_view text,
                    const Eigen::Vector2f& low,
                    const Eigen::Vector2f& high,
                    Lettering lettering,
                    Canvas& canvas) {
  const Eigen::Vector2f size = high - low;
  const float scale =
      std::min({1.0F, size.x() / TextWidth(text, lettering), size.y() / lettering.height});
  lettering.height *= scale;
  lettering.stroke *= scale;
  const float width = TextWidth(text, lettering);
  DrawText(text,
           {low.x() + 0.5F * (size.x() - width), high.y() - 0.5F * (size.y() - lettering.height)},
           lettering,
           canvas);
}

}  // namespace relocd
