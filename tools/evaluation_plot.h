#pragma once

#include <string>

#include "core/result.h"
#include "evaluation.h"

namespace relocd {

/// Draws the evaluation as a PNG: the truth and the estimates seen from above, coloured by their
/// error, with the reported 95 % ellipses, and below it the error over time with its reported 95 %
/// bound. "Above" is along the axis that the truth moves least along.
///
/// @return kUnavailable when the file cannot be written.
Result<void> WritePlot(const Evaluation& evaluation,
                       const std::string& title,
                       const std::string& path);

}  // namespace relocd
