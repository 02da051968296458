#include <algorithm>
#include <iterator>
#include <string_view>

#include <fmt/format.h>

#include "base64.h"
#include "core/file.h"
#include "escape_html.h"
#include "map_report.h"

namespace relocd {
namespace {

constexpr std::string_view kStyle = R"(
:root{color-scheme:light dark;--page:#fff;--card:#f5f6f8;--ink:#20262d;--soft:#5c6670;--line:#dfe3e8;--bad:#be1860}
@media(prefers-color-scheme:dark){:root{--page:#161a20;--card:#1e242c;--ink:#d6d9de;--soft:#98a2ad;--line:#323a44;--bad:#ff6cb2}}
body{margin:0 auto;max-width:1000px;padding:1.2rem 1rem 3rem;background:var(--page);color:var(--ink);
font:16px/1.5 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin:2rem 0 .6rem}
.soft{color:var(--soft);font-size:.9rem}.bad{color:var(--bad);font-weight:600}
.wide{overflow-x:auto}img{display:block;width:100%;height:auto;border-radius:8px}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.35rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left}
.frames{display:grid;grid-template-columns:repeat(auto-fill,minmax(280px,1fr));gap:.9rem}
figure{margin:0;background:var(--card);border-radius:10px;overflow:hidden}figcaption{padding:.5rem .7rem;font-size:.85rem}
.key i{display:inline-block;width:.75em;height:.75em;border-radius:50%;margin:0 .35em 0 .9em}
)";

constexpr std::string_view kKey =
    "<p class=\"key soft\"><i style=\"background:#00966e\"></i>held-out image off by less than "
    "0.25 m<i style=\"background:#e6a01e\"></i>less than 1 m<i style=\"background:#d55e00\"></i>"
    "more<i style=\"background:#be1860\"></i>not found</p>\n";

/// Errors of images that were not found would look like very good ones.
std::string AccuracyCells(const PoseErrors& errors) {
  if (errors.localized == 0) return "<td>–</td><td>–</td><td>–</td><td>–</td><td>–</td>";
  constexpr double kDegrees = 57.29577951308232;
  return fmt::format(
      "<td>{:.3f}</td><td>{:.2f}</td><td>{:.3f}</td><td>{:.0f} %</td><td>{:.0f} %</td>",
      errors.median_m,
      errors.median_rad * kDegrees,
      errors.p95_m,
      100.0 * errors.within_1m,
      100.0 * errors.within_95);
}

/// How good the map is, in a sentence.
std::string Verdict(const PoseErrors& errors) {
  if (errors.localized == 0) {
    return fmt::format("None of {} held-out images is found.", errors.frames);
  }
  return fmt::format(
      "{} of {} held-out images are found, with a median error of {:.3f} m (p95 {:.3f} m); {:.0f} "
      "% of them are inside the reported 95 % region.",
      errors.localized,
      errors.frames,
      errors.median_m,
      errors.p95_m,
      100.0 * errors.within_95);
}

void AppendRegions(const TrainingReport& report, std::string& html) {
  html +=
      "<h2>Regions</h2>\n<div class=\"wide\"><table>\n<thead><tr><th></th><th>metres</th>"
      "<th>training images</th><th>held out, found</th><th>median, m</th><th>median, deg</th>"
      "<th>p95, m</th><th>within 1 m</th><th>inside 95 %</th></tr></thead>\n<tbody>\n";
  for (const RegionReport& region : report.regions) {
    fmt::format_to(std::back_inserter(html),
                   "<tr><td>{}</td><td>{:.0f} – {:.0f}</td><td>{}</td><td>{} of {}</td>{}</tr>\n",
                   EscapeHtml(region.name),
                   region.begin_m,
                   region.end_m,
                   region.training_frames,
                   region.errors.localized,
                   region.errors.frames,
                   AccuracyCells(region.errors));
  }
  html += "</tbody></table></div>\n";
}

Result<void> AppendWeak(const TrainingReport& report, std::string& html) {
  constexpr std::size_t kMostPictures = 12;
  html += "<h2>What to drive again</h2>\n";
  if (report.weak.empty()) {
    html += "<p>Nothing: no held-out image is lost or far off.</p>\n";
    return {};
  }
  html += "<div class=\"frames\">\n";
  for (std::size_t i = 0; i < report.weak.size(); ++i) {
    const WeakStretch& stretch = report.weak[i];
    std::string picture;
    if (i < kMostPictures) {
      const auto jpeg = ReadFile(report.held_out[stretch.worst].image);
      if (!jpeg) return jpeg.error();
      picture = fmt::format("<img alt=\"{}\" src=\"data:image/jpeg;base64,{}\">",
                            EscapeHtml(report.held_out[stretch.worst].name),
                            EncodeBase64(*jpeg));
    }
    fmt::format_to(std::back_inserter(html),
                   "<figure>{}<figcaption>{}</figcaption></figure>\n",
                   picture,
                   EscapeHtml(DescribeWeakStretch(stretch)));
  }
  html += "</div>\n";
  return {};
}

void AppendLive(const TrainingReport& report, std::string& html) {
  const bool has_live = std::any_of(report.regions.begin(),
                                    report.regions.end(),
                                    [](const auto& region) { return !region.live.empty(); });
  if (!has_live) return;
  html +=
      "<h2>How it was learned</h2>\n<div class=\"wide\"><table>\n<thead><tr><th></th>"
      "<th>iteration</th><th>found</th><th>median, m</th></tr></thead>\n<tbody>\n";
  for (const RegionReport& region : report.regions) {
    for (const LiveAccuracy& live : region.live) {
      fmt::format_to(std::back_inserter(html),
                     "<tr><td>{}</td><td>{}</td><td>{} of {}</td><td>{:.2f}</td></tr>\n",
                     EscapeHtml(region.name),
                     live.iteration,
                     live.localized,
                     live.frames,
                     live.median_m);
    }
  }
  html += "</tbody></table></div>\n";
}

}  // namespace

Result<std::string> FormatTrainingReportHtml(const TrainingReport& report) {
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta "
      "name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>Map of "
      "{0}</title>\n<style>{1}</style>\n</head>\n<body>\n<h1>Map of {0}</h1>\n<p>{2:.0f} m in {3}. "
      "{4}</p>\n",
      EscapeHtml(report.datasets),
      kStyle,
      report.route_m,
      report.regions.size() == 1 ? "one region" : fmt::format("{} regions", report.regions.size()),
      Verdict(report.errors));
  fmt::format_to(std::back_inserter(html),
                 "<h2>The route from above</h2>\n<picture><source media=\"(prefers-color-scheme: "
                 "dark)\" srcset=\"data:image/png;base64,{}\"><img alt=\"the route with the "
                 "held-out images\" src=\"data:image/png;base64,{}\"></picture>\n{}",
                 EncodeBase64(PlotTrainingReport(report, true)),
                 EncodeBase64(PlotTrainingReport(report, false)),
                 kKey);
  AppendRegions(report, html);
  if (auto weak = AppendWeak(report, html); !weak) return weak.error();
  AppendLive(report, html);
  fmt::format_to(std::back_inserter(html),
                 "<p class=\"soft\">{}. Held-out images are of the same drives as the others: on "
                 "another day, in other light, errors are larger.</p>\n</body>\n</html>\n",
                 EscapeHtml(report.how));
  return html;
}

}  // namespace relocd
