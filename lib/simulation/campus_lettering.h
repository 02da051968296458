#pragma once

#include <string_view>

#include "simulation/campus_canvas.h"

namespace relocd {

/// How letters are painted, lengths in pixels.
struct Lettering {
  float height = 32.0F;  ///< Of capitals.
  float stroke = 5.0F;
  float slant = 0.0F;  ///< To the right per height.
  Paint paint = OpaquePaint(0.1F, 0.1F, 0.1F);
};

/// Width in pixels of a text. Letters are A to Z, 0 to 9 and `&.-'` and the space; others are left
/// out.
float TextWidth(std::string_view text, const Lettering& lettering);

/// Paints strokes from the lower left corner of the first letter on.
void DrawText(std::string_view text,
              const Eigen::Vector2f& lower_left,
              const Lettering& lettering,
              Canvas& canvas);

/// The same in the middle of a rectangle, smaller where it would not fit.
void DrawTextWithin(std::string_view text,
                    const Eigen::Vector2f& low,
                    const Eigen::Vector2f& high,
                    Lettering lettering,
                    Canvas& canvas);

}  // namespace relocd
