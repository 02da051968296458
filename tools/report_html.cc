#include "report_html.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include <fmt/format.h>

#include "escape_html.h"

namespace relocd {
namespace {

constexpr double kPercent = 100.0;

constexpr std::string_view kStyle = R"(
:root{color-scheme:light dark;--page:#fff;--card:#f5f6f8;--ink:#20262d;--soft:#5c6670;--line:#dfe3e8;
--good:#00966e;--camera:#2880c8;--odometry:#d55e00;--bad:#be1860;--none:#a0a8b2}
@media(prefers-color-scheme:dark){:root{--page:#161a20;--card:#1e242c;--ink:#d6d9de;--soft:#98a2ad;--line:#323a44;
--good:#32d6a0;--camera:#6ebaff;--odometry:#ff8c42;--bad:#ff6cb2;--none:#727a84}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1080px;padding:1.2rem 1rem 3rem;background:var(--page);color:var(--ink);
font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
h1{font-size:1.5rem;line-height:1.25;margin:.2rem 0}
h2{font-size:1.15rem;margin:2.2rem 0 .6rem}
p{margin:.4rem 0}
.soft{color:var(--soft);font-size:.9rem}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:.7rem;margin:1.2rem 0}
.card{background:var(--card);border-radius:10px;padding:.7rem .9rem;border-left:4px solid var(--none)}
.card b{display:block;font-size:1.35rem;line-height:1.3;font-variant-numeric:tabular-nums}
.card span{display:block;color:var(--soft);font-size:.85rem;line-height:1.35}
.fused{border-color:var(--good)}.camera{border-color:var(--camera)}.odometry{border-color:var(--odometry)}
.wide{overflow-x:auto;-webkit-overflow-scrolling:touch}
.wide img{display:block;width:100%;min-width:620px;height:auto;border-radius:8px}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.35rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left;white-space:normal;min-width:8.5rem}
thead th{color:var(--soft);font-weight:600}
th[colspan]{text-align:center}
tr.fused td{font-weight:600}
td.bad{color:var(--bad);font-weight:600}
.bar{display:flex;height:16px;border-radius:8px;overflow:hidden;margin:.5rem 0;background:var(--card)}
.bar i{display:block}
.key i{display:inline-block;width:.75em;height:.75em;border-radius:3px;margin:0 .35em 0 0}
.key span{margin-right:1.1em;white-space:nowrap}
.s-ok{background:var(--good)}.s-converging{background:var(--camera)}.s-dead_reckoning{background:var(--odometry)}
.s-other{background:var(--bad)}.s-none{background:var(--none)}
.frames{display:grid;grid-template-columns:repeat(auto-fill,minmax(230px,1fr));gap:.9rem}
.frames.pairs{grid-template-columns:repeat(auto-fill,minmax(300px,1fr))}
figure{margin:0;background:var(--card);border-radius:10px;overflow:hidden}
figure .two{display:flex;gap:2px}
figure .two>div{flex:1;position:relative}
figure img{display:block;width:100%;height:auto}
figure em{position:absolute;left:.4rem;top:.4rem;padding:0 .45rem;border-radius:5px;background:rgba(0,0,0,.6);color:#fff;
font-size:.72rem;font-style:normal;line-height:1.5}
figcaption{padding:.5rem .7rem .65rem;font-size:.85rem;line-height:1.45;font-variant-numeric:tabular-nums}
figcaption b{font-size:.95rem}
.meter{display:block;height:5px;border-radius:3px;background:var(--line);margin-top:.35rem;overflow:hidden}
.meter i{display:block;height:100%;background:var(--camera)}
.red{color:var(--bad);font-weight:600}
)";

/// Statuses for people: `dead_reckoning` is `dead reckoning`.
std::string Words(std::string_view status) {
  std::string words = EscapeHtml(status);
  std::ranges::replace(words, '_', ' ');
  return words;
}

std::string DataUri(std::string_view type, std::string_view bytes) {
  return fmt::format("data:{};base64,{}", type, EncodeBase64(bytes));
}

void AppendCard(std::string_view kind,
                const std::string& number,
                const std::string& text,
                std::string& html) {
  fmt::format_to(std::back_inserter(html),
                 "<div class=\"card {}\"><b>{}</b><span>{}</span></div>\n",
                 kind,
                 EscapeHtml(number),
                 EscapeHtml(text));
}

void AppendCards(const DriveReport& report, std::string& html) {
  html += "<div class=\"cards\">\n";
  const ErrorSummary& fused = report.fused.position_m;
  AppendCard("fused",
             fmt::format("{:.2f} m", fused.mean),
             fmt::format("fused, mean error (largest {:.2f} m)", fused.max),
             html);
  if (report.fused.heading_deg.count > 0) {
    AppendCard(
        "fused",
        fmt::format("{:.2f}°", report.fused.heading_deg.mean),
        fmt::format("fused, mean heading error (largest {:.2f}°)", report.fused.heading_deg.max),
        html);
  }
  AppendCard("odometry",
             fmt::format("{:.2f} m", report.odometry.position_m.mean),
             fmt::format("odometry alone (largest {:.2f} m)", report.odometry.position_m.max),
             html);
  if (report.camera.evaluation) {
    AppendCard("camera",
               fmt::format("{:.2f} m", report.camera.position_m.mean),
               fmt::format("camera alone (largest {:.2f} m, {} off by over {:g} m)",
                           report.camera.position_m.max,
                           report.camera.outliers,
                           kOutlierM),
               html);
  } else {
    AppendCard("camera", "no pose", "camera alone", html);
  }
  html += "</div>\n";
}

void AppendFigure(const ReportFigure& figure, std::string_view what, std::string& html) {
  fmt::format_to(std::back_inserter(html),
                 "<div class=\"wide\"><picture><source media=\"(prefers-color-scheme: dark)\" "
                 "srcset=\"{}\"><img alt=\"{}\" src=\"{}\"></picture></div>\n",
                 DataUri(figure.type, figure.dark),
                 what,
                 DataUri(figure.type, figure.light));
}

void AppendErrorRow(const ReportRow& row, std::string& html) {
  fmt::format_to(std::back_inserter(html),
                 "<tr class=\"{}\"><td>{}</td><td>{}</td>",
                 row.key,
                 EscapeHtml(row.name),
                 row.position_m.count);
  if (!row.evaluation) {
    html += "<td colspan=\"9\">no pose to compare</td></tr>\n";
    return;
  }
  const ErrorSummary& position = row.position_m;
  for (const double value :
       {position.mean, position.rmse, position.median, position.p95, position.max})
    fmt::format_to(std::back_inserter(html), "<td>{:.3f}</td>", value);
  const ErrorSummary& heading = row.heading_deg;
  for (const double value : {heading.mean, heading.rmse, heading.max}) {
    html += heading.count > 0 ? fmt::format("<td>{:.2f}</td>", value) : "<td>–</td>";
  }
  fmt::format_to(std::back_inserter(html),
                 "<td{}>{}</td></tr>\n",
                 row.outliers > 0 ? " class=\"bad\"" : "",
                 row.outliers);
}

void AppendErrorTable(const DriveReport& report, std::string& html) {
  html +=
      "<div class=\"wide\"><table>\n<thead><tr><th></th><th></th><th colspan=\"5\">position error, "
      "m</th><th colspan=\"3\">heading error, °</th><th></th></tr>\n"
      "<tr><th></th><th>poses</th><th>mean</th><th>RMSE</th><th>median</th><th>p95</th><th>max</th>"
      "<th>mean</th><th>RMSE</th><th>max</th><th>&gt; 1 m</th></tr></thead>\n<tbody>\n";
  for (const ReportRow* row : report.rows())
    AppendErrorRow(*row, html);
  html += "</tbody></table></div>\n";
}

void AppendCoverageTable(const DriveReport& report, std::string& html) {
  html +=
      "<div class=\"wide\"><table>\n<thead><tr><th>truth inside the reported 95 %</th><th>(x, "
      "y)</th><th>with heading</th><th>median sigma, m</th></tr></thead>\n<tbody>\n";
  for (const ReportRow* row : {&report.camera, &report.fused}) {
    fmt::format_to(
        std::back_inserter(html), "<tr class=\"{}\"><td>{}</td>", row->key, EscapeHtml(row->name));
    if (row->evaluation && row->evaluation->coverage.position_count > 0) {
      const Coverage& coverage = row->evaluation->coverage;
      fmt::format_to(std::back_inserter(html),
                     "<td>{:.1f} %</td><td>{}</td><td>{:.3f}</td></tr>\n",
                     kPercent * coverage.position_share,
                     coverage.pose_count > 0
                         ? fmt::format("{:.1f} %", kPercent * coverage.pose_share)
                         : std::string("–"),
                     row->evaluation->median_sigma_m);
    } else {
      html += "<td colspan=\"3\">no covariance is reported</td></tr>\n";
    }
  }
  html += "</tbody></table></div>\n";
}

std::string StatusClass(std::string_view status) {
  if (status == "ok" || status == "converging" || status == "dead_reckoning") {
    return fmt::format("s-{}", status);
  }
  return status == "uninitialised" || status == "silent" ? "s-none" : "s-other";
}

void AppendStatuses(const DriveReport& report, std::string& html) {
  if (report.status_shares.empty()) return;
  html += "<h2>Status of the pose over time</h2>\n<div class=\"bar\">";
  for (const StatusSpan& span : report.status_spans) {
    fmt::format_to(std::back_inserter(html),
                   "<i class=\"{}\" style=\"flex:{}\"></i>",
                   StatusClass(span.status),
                   static_cast<double>(span.end_ns - span.begin_ns) * 1e-9);
  }
  html += "</div>\n<p class=\"key\">";
  for (const auto& [status, share] : report.status_shares) {
    fmt::format_to(std::back_inserter(html),
                   "<span><i class=\"{}\"></i>{} {:.1f} %</span> ",
                   StatusClass(status),
                   Words(status),
                   kPercent * share);
  }
  html += "</p>\n";
}

void AppendLatencies(const DriveReport& report, std::string& html) {
  if (!report.log) return;
  html +=
      "<h2>Latency</h2>\n<div class=\"wide\"><table>\n<thead><tr><th></th><th>p50, ms</th><th>p99, "
      "ms</th></tr></thead>\n<tbody>\n";
  for (const ReportedLatency& latency : report.log->latencies) {
    fmt::format_to(std::back_inserter(html),
                   "<tr><td>{}</td><td>{:.2f}</td><td>{:.2f}</td></tr>\n",
                   EscapeHtml(latency.name),
                   latency.p50_ms,
                   latency.p99_ms);
  }
  fmt::format_to(std::back_inserter(html),
                 "</tbody></table></div>\n<p class=\"soft\">{} messages in the log, {} lost</p>\n",
                 report.log->messages,
                 report.log->lost);
}

/// What the camera made of a frame.
std::string CameraCaption(const ReportFrame& frame) {
  if (frame.camera_error_m) {
    const bool is_outlier = *frame.camera_error_m > kOutlierM;
    return fmt::format("camera <span{}>{:.2f} m</span> off",
                       is_outlier ? " class=\"red\"" : "",
                       *frame.camera_error_m);
  }
  if (frame.camera_status.empty()) return "camera: not worked on";
  return fmt::format("camera: <span class=\"red\">{}</span>", Words(frame.camera_status));
}

void AppendFrame(const ReportFrame& frame, std::string& html) {
  html += "<figure>";
  const std::string image = fmt::format("<img alt=\"the camera's image at {:.1f} s\" src=\"{}\">",
                                        frame.time_s,
                                        DataUri("image/jpeg", frame.jpeg));
  if (frame.teach_jpeg.empty()) {
    html += image;
  } else {
    constexpr double kSamePlaceM = 0.05;
    const std::string where = frame.teach_distance_m < kSamePlaceM
                                  ? std::string("teach")
                                  : fmt::format("teach, {:.1f} m away", frame.teach_distance_m);
    fmt::format_to(std::back_inserter(html),
                   "<div class=\"two\"><div><em>{}</em><img alt=\"the teach drive here\" "
                   "src=\"{}\"></div><div><em>this drive</em>{}</div></div>",
                   where,
                   DataUri("image/jpeg", frame.teach_jpeg),
                   image);
  }
  fmt::format_to(std::back_inserter(html),
                 "<figcaption><b>{:.1f} s</b> · {}",
                 frame.time_s,
                 CameraCaption(frame));
  if (frame.fused_error_m) {
    fmt::format_to(std::back_inserter(html), " · fused {:.2f} m", *frame.fused_error_m);
  }
  if (!frame.status.empty() && frame.status != "ok") html += " · " + Words(frame.status);
  if (frame.confidence) {
    const double percent = kPercent * std::clamp(*frame.confidence, 0.0, 1.0);
    fmt::format_to(
        std::back_inserter(html),
        "<br>confidence {:.2f}<span class=\"meter\"><i style=\"width:{:.1f}%\"></i></span>",
        *frame.confidence,
        percent);
  }
  html += "</figcaption></figure>\n";
}

void AppendFrames(const std::vector<ReportFrame>& frames, std::string& html) {
  if (frames.empty()) return;
  const bool has_pairs = std::ranges::any_of(
      frames, [](const ReportFrame& frame) { return !frame.teach_jpeg.empty(); });
  html += has_pairs ? "<h2>What the camera saw, beside the teach drive</h2>\n<div class=\"frames "
                      "pairs\">\n"
                    : "<h2>What the camera saw</h2>\n<div class=\"frames\">\n";
  for (const ReportFrame& frame : frames)
    AppendFrame(frame, html);
  html += "</div>\n";
}

}  // namespace

std::string FormatReportHtml(const DriveReport& report,
                             const ReportFigure& drive,
                             const ReportFigure& errors,
                             const std::vector<ReportFrame>& frames) {
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{0}</title>\n<style>{1}</style>\n</head>\n<body>\n<h1>{0}</h1>\n<p>{2}.</p>\n",
      EscapeHtml(report.title),
      kStyle,
      EscapeHtml(DescribeOutcome(report)));
  AppendCards(report, html);
  html += "<h2>From above</h2>\n";
  AppendFigure(drive, "The drive from above: truth, odometry, camera and fused poses", html);
  html += "<h2>Errors</h2>\n";
  AppendErrorTable(report, html);
  fmt::format_to(std::back_inserter(html),
                 "<p class=\"soft\">Images: {}.</p>\n",
                 EscapeHtml(DescribeImages(report)));
  html += "<h2>Errors over time</h2>\n";
  AppendFigure(errors, "The errors of position and heading over time", html);
  html += "<h2>How honest the reported uncertainty is</h2>\n";
  AppendCoverageTable(report, html);
  AppendStatuses(report, html);
  AppendFrames(frames, html);
  AppendLatencies(report, html);
  fmt::format_to(
      std::back_inserter(html),
      "<p class=\"soft\">Truth: {}. Odometry alone starts at the true first pose; aligned, "
      "it is laid over the truth as well as it goes.</p>\n</body>\n</html>\n",
      EscapeHtml(report.truth_path));
  return html;
}

}  // namespace relocd
