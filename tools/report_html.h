#pragma once

#include <string>
#include <vector>

#include "base64.h"
#include "report_frames.h"
#include "report_numbers.h"

namespace relocd {

/// A figure for readers with a light and with a dark screen.
struct ReportFigure {
  std::string type = "image/png";
  std::string light;
  std::string dark;
};

/// The report as one page that needs nothing else: no links, no scripts, pictures within.
std::string FormatReportHtml(const DriveReport& report,
                             const ReportFigure& drive,
                             const ReportFigure& errors,
                             const std::vector<ReportFrame>& frames);

}  // namespace relocd
