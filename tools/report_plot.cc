#include "report_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "geometry/covariance.h"
#include "geometry/planar.h"

namespace relocd {
namespace {

// In units of the canvas, of which a pixel is two thirds.
constexpr double kPixelsPerUnit = 1.5;
constexpr double kWidth = 960.0;
constexpr double kLeft = 66.0;
constexpr double kPanelWidth = 872.0;
constexpr double kMinMapHeight = 240.0;
constexpr double kMaxMapHeight = 720.0;
constexpr double kMapTop = 132.0;
constexpr double kBetween = 86.0;
constexpr double kNearHeight = 250.0;
constexpr double kNearGap = 72.0;
constexpr double kBottom = 56.0;

Eigen::Vector2d Position(const Pose3& X_WB) {
  return X_WB.translation().head<2>();
}

/// Half the long axis of the reported 95 % ellipse, in m.
double HalfAxis(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d position = covariance.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(position, Eigen::EigenvaluesOnly);
  return std::sqrt(kChiSquared95Dof2 * axes.eigenvalues()[1]);
}

/// Puts equal scales on both axes around what is in x and y.
Panel EqualScales(cv::Rect2d box, Range x, Range y) {
  const double metres_per_unit = std::max(x.size() / box.width, y.size() / box.height);
  x.Grow(0.5 * (metres_per_unit * box.width - x.size()));
  y.Grow(0.5 * (metres_per_unit * box.height - y.size()));
  return {.box = box, .x = x, .y = y};
}

/// Shows all of the truth and the fused poses, and the odometry as far as it does not make them
/// small.
Panel MakeMapPanel(const DriveReport& report) {
  Range x;
  Range y;
  const auto include = [&](const Eigen::Vector2d& point) {
    x.Include(point.x());
    y.Include(point.y());
  };
  for (const PosePair& pair : report.fused.evaluation->pairs) {
    include(Position(pair.X_WB_true));
    include(Position(pair.X_WB));
  }
  constexpr double kMostForOdometry = 0.3;
  const double room = kMostForOdometry * std::max({x.size(), y.size(), 1.0});
  Range x_room = x;
  Range y_room = y;
  x_room.Grow(room);
  y_room.Grow(room);
  for (const PosePair& pair : report.odometry.evaluation->pairs) {
    const Eigen::Vector2d point = Position(pair.X_WB);
    if (x_room.Contains(point.x()) && y_room.Contains(point.y())) include(point);
  }
  constexpr double kMargin = 0.05;
  constexpr double kLeastMarginM = 0.5;  // for a robot that stands
  const double margin = std::max(kLeastMarginM, kMargin * std::max(x.size(), y.size()));
  x.Grow(margin);
  y.Grow(margin);
  const double height = std::clamp(kPanelWidth * y.size() / x.size(), kMinMapHeight, kMaxMapHeight);
  return EqualScales({kLeft, kMapTop, kPanelWidth, height}, x, y);
}

/// The way in the canvas's units, without points that are nearer to each other than the eye sees.
template <typename Poses, typename PositionOf>
std::vector<cv::Point2d> Way(const Panel& panel, const Poses& poses, const PositionOf& position) {
  constexpr double kNear = 0.4;
  std::vector<cv::Point2d> way;
  for (const auto& pose : poses) {
    const cv::Point2d point = panel.Pixel(position(pose));
    if (way.empty() || cv::norm(point - way.back()) > kNear) way.push_back(point);
  }
  return way;
}

/// Which of the ellipses are drawn, and how large.
struct EllipseChoice {
  double magnification = 1.0;
  double every_m = 0.0;
};

EllipseChoice ChooseEllipses(const Panel& panel, const Evaluation& fused) {
  std::vector<double> half_axes_m;
  for (const EvaluatedPose& estimate : fused.estimates) {
    if (estimate.covariance) half_axes_m.push_back(HalfAxis(*estimate.covariance));
  }
  const double half_axis_m = Summarize(std::move(half_axes_m)).median;
  const double units_per_m = panel.box.width / panel.x.size();
  constexpr double kVisible = 7.0;
  constexpr std::array<double, 8> kMagnifications{1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0};
  EllipseChoice choice;
  for (const double magnification : kMagnifications) {
    choice.magnification = magnification;
    if (magnification * half_axis_m * units_per_m >= kVisible) break;
  }
  constexpr double kLeastDistance = 26.0;
  constexpr double kApart = 2.6;
  const double apart_m =
      std::max(kLeastDistance / units_per_m, kApart * choice.magnification * half_axis_m);
  choice.every_m = NiceStep(apart_m, 1.0);
  return choice;
}

void DrawEllipses(Canvas& canvas,
                  const Panel& panel,
                  const Evaluation& fused,
                  const EllipseChoice& choice,
                  const cv::Scalar& colour) {
  // Those of a pose that is hardly known would hide all others: only their outline is drawn.
  constexpr double kMostFilled = 0.1;
  const double most_filled_m = kMostFilled * panel.x.size();
  std::vector<std::vector<cv::Point2d>> ellipses;
  std::vector<std::vector<cv::Point2d>> filled;
  double next_m = 0.0;
  double travelled_m = 0.0;
  for (std::size_t i = 0; i < fused.pairs.size(); ++i) {
    if (i > 0) {
      travelled_m +=
          (fused.pairs[i].X_WB_true.translation() - fused.pairs[i - 1].X_WB_true.translation())
              .norm();
    }
    const auto& covariance = fused.estimates[i].covariance;
    if (!covariance || travelled_m < next_m) continue;
    next_m = travelled_m + choice.every_m;
    const Eigen::Matrix2d position = covariance->topLeftCorner<2, 2>();
    ellipses.push_back(
        EllipsePixels(panel, ProjectToPlane(fused.pairs[i].X_WB), position, choice.magnification));
    if (choice.magnification * HalfAxis(*covariance) < most_filled_m) {
      filled.push_back(ellipses.back());
    }
  }
  constexpr double kOpacity = 0.2;
  canvas.Translucent(kOpacity, [&] {
    for (const auto& ellipse : filled)
      canvas.Polygon(ellipse, colour);
  });
  for (const auto& ellipse : ellipses)
    canvas.Polyline(ellipse, colour, 0.6);
}

/// The sizes of dots and lines.
struct Strokes {
  double truth = 5.0;
  double odometry = 1.3;
  double fused = 1.5;
  double dot = 1.4;
  double outlier = 2.6;
};

/// Those that are no outliers.
void DrawCamera(Canvas& canvas,
                const Panel& panel,
                const DriveReport& report,
                const cv::Scalar& colour,
                double radius) {
  if (!report.camera.evaluation) return;
  const std::vector<PosePair>& pairs = report.camera.evaluation->pairs;
  const std::vector<double> errors = PositionErrors(pairs);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (errors[i] > kOutlierM) continue;
    canvas.Dot(panel.Pixel(Position(pairs[i].X_WB)), radius, colour);
  }
}

/// Joined to the truth, so that none is hidden.
void DrawOutliers(Canvas& canvas,
                  const Panel& panel,
                  const DriveReport& report,
                  const cv::Scalar& colour,
                  double radius) {
  if (!report.camera.evaluation) return;
  const std::vector<PosePair>& pairs = report.camera.evaluation->pairs;
  const std::vector<double> errors = PositionErrors(pairs);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (errors[i] <= kOutlierM) continue;
    const cv::Point2d point = panel.Pixel(Position(pairs[i].X_WB));
    canvas.Line(panel.Pixel(Position(pairs[i].X_WB_true)), point, colour, 0.8);
    canvas.Dot(point, radius, colour);
  }
}

void DrawWays(Canvas& canvas,
              const Panel& panel,
              const DriveReport& report,
              const ReportColours& colours,
              const Strokes& strokes) {
  const auto estimated = [](const PosePair& pair) { return Position(pair.X_WB); };
  canvas.Polyline(
      Way(panel, report.truths, [](const EvaluatedPose& pose) { return Position(pose.X_WB); }),
      colours.truth,
      strokes.truth);
  canvas.Polyline(
      Way(panel, report.odometry.evaluation->pairs, estimated), colours.odometry, strokes.odometry);
  DrawCamera(canvas, panel, report, colours.camera, strokes.dot);
  canvas.Polyline(
      Way(panel, report.fused.evaluation->pairs, estimated), colours.fused, strokes.fused);
  DrawOutliers(canvas, panel, report, colours.outlier, strokes.outlier);
}

/// Goes along a line and begins a new one where an entry does not fit any more.
class Legend {
 public:
  Legend(Canvas& canvas, double top) : canvas_(canvas), y_(top) {}

  template <typename DrawSample>
  void Add(const std::string& text, const DrawSample& draw_sample) {
    const double width = kSample + kGap + canvas_.TextWidth(text, kHeight);
    if (x_ > kLeft && x_ + width > kLeft + kPanelWidth) {
      x_ = kLeft;
      y_ += kRow;
    }
    draw_sample(cv::Point2d(x_, y_), cv::Point2d(x_ + kSample, y_));
    canvas_.Text(text, {x_ + kSample + kGap, y_}, {0.0, 0.5}, kHeight);
    x_ += width + kBetweenEntries;
  }

 private:
  static constexpr double kSample = 24.0;
  static constexpr double kGap = 6.0;
  static constexpr double kRow = 22.0;
  static constexpr double kBetweenEntries = 22.0;
  static constexpr double kHeight = 13.0;

  Canvas& canvas_;
  double x_ = kLeft;
  double y_;
};

/// How many of the outliers lie outside the map.
std::size_t HiddenOutliers(const Panel& panel, const DriveReport& report) {
  if (!report.camera.evaluation) return 0;
  const std::vector<PosePair>& pairs = report.camera.evaluation->pairs;
  return static_cast<std::size_t>(std::ranges::count_if(
      pairs, [&](const PosePair& pair) { return !panel.Contains(Position(pair.X_WB)); }));
}

void DrawLegend(Canvas& canvas,
                const Panel& panel,
                const DriveReport& report,
                const ReportColours& colours,
                const EllipseChoice& ellipses) {
  constexpr double kTop = 72.0;
  Legend legend(canvas, kTop);
  const auto line = [&canvas](const cv::Scalar& colour, double width) {
    return [&canvas, colour, width](cv::Point2d from, cv::Point2d to) {
      canvas.Line(from, to, colour, width);
    };
  };
  const auto dot = [&canvas](const cv::Scalar& colour, double radius) {
    return [&canvas, colour, radius](cv::Point2d from, cv::Point2d to) {
      canvas.Dot(0.5 * (from + to), radius, colour);
    };
  };
  const Strokes strokes;
  legend.Add("truth", line(colours.truth, strokes.truth));
  legend.Add("odometry alone", line(colours.odometry, strokes.odometry));
  legend.Add("camera alone", dot(colours.camera, strokes.dot + 1.0));
  if (report.camera.outliers > 0) {
    const std::size_t hidden = HiddenOutliers(panel, report);
    std::string text =
        fmt::format("{} camera poses off by > {:g} m", report.camera.outliers, kOutlierM);
    if (hidden > 0) text += fmt::format(" ({} beyond the view)", hidden);
    legend.Add(text, dot(colours.outlier, strokes.outlier));
  }
  legend.Add("fused", line(colours.fused, strokes.fused + 0.5));
  if (ellipses.every_m <= 0.0) return;
  const std::string size = ellipses.magnification > 1.0
                               ? fmt::format(", drawn {:g} times as large", ellipses.magnification)
                               : std::string(", to scale");
  legend.Add(fmt::format("reported 95 % every {:g} m{}", ellipses.every_m, size),
             [&](cv::Point2d from, cv::Point2d to) {
               constexpr double kOpacity = 0.3;
               canvas.Translucent(kOpacity,
                                  [&] { canvas.Dot(0.5 * (from + to), 8.0, colours.fused); });
             });
}

/// Start, end, and the axes of W.
void DrawMarks(Canvas& canvas, const Panel& panel, const DriveReport& report) {
  const cv::Scalar& ink = canvas.theme().ink;
  constexpr double kRing = 6.5;
  const auto mark = [&](const EvaluatedPose& pose, const cv::Scalar& inside, const char* name) {
    const cv::Point2d at = panel.Pixel(Position(pose.X_WB));
    canvas.Dot(at, kRing, ink);
    canvas.Dot(at, kRing - 2.0, inside);
    const bool is_right = at.x > panel.box.x + 0.85 * panel.box.width;
    canvas.TextWithHalo(name,
                        {at.x + (is_right ? -kRing - 4.0 : kRing + 4.0), at.y - kRing},
                        {is_right ? 1.0 : 0.0, 1.0},
                        {.height = 14.0, .weight = 1.3});
  };
  mark(report.truths.back(), ink, "end");
  mark(report.truths.front(), canvas.theme().background, "start");

  constexpr double kArm = 34.0;
  constexpr double kHead = 5.0;
  const cv::Point2d origin(panel.box.br().x - kArm - 26.0, panel.box.y + kArm + 26.0);
  const auto arrow = [&](cv::Point2d along, const char* name) {
    const cv::Point2d tip = origin + kArm * along;
    const cv::Point2d across(-along.y, along.x);
    canvas.Line(origin, tip, ink, 1.2);
    canvas.Line(tip, tip - kHead * (along - 0.6 * across), ink, 1.2);
    canvas.Line(tip, tip - kHead * (along + 0.6 * across), ink, 1.2);
    canvas.Text(name, tip + 11.0 * along, {0.5, 0.5});
  };
  arrow({1.0, 0.0}, "x");
  arrow({0.0, -1.0}, "y");
}

void DrawTopView(Canvas& canvas, const Panel& panel, const TopView& view) {
  if (view.picture.empty()) return;
  const cv::Point2d top_left = panel.Pixel({view.x.low, view.y.high});
  const cv::Point2d bottom_right = panel.Pixel({view.x.high, view.y.low});
  constexpr double kOpacity = 0.55;  // so that the lines over it stay visible
  canvas.Within(panel.box, [&] {
    canvas.Translucent(kOpacity,
                       [&] { canvas.Picture(view.picture, cv::Rect2d(top_left, bottom_right)); });
  });
}

/// A place of the way that is shown from near.
struct Place {
  std::string letter;
  std::string what;
  std::size_t index = 0;  ///< Of the fused pose.
};

std::array<Place, 2> ChoosePlaces(const DriveReport& report) {
  const std::vector<double> errors = PositionErrors(report.fused.evaluation->pairs);
  const auto largest = std::ranges::max_element(errors);
  const double median = report.fused.position_m.median;
  const auto largest_at = static_cast<std::size_t>(largest - errors.begin());
  // Of the places with about the median error one in the middle of the half that A is not in.
  constexpr double kAbout = 0.1;
  const std::size_t quarter = errors.size() / 4;
  const std::size_t wanted = largest_at < errors.size() / 2 ? 3 * quarter : quarter;
  const auto apart = [wanted](std::size_t i) { return i > wanted ? i - wanted : wanted - i; };
  std::size_t typical = wanted;
  std::size_t least_apart = errors.size();
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (std::abs(errors[i] - median) > kAbout * median || apart(i) >= least_apart) continue;
    typical = i;
    least_apart = apart(i);
  }
  return {Place{.letter = "A", .what = "largest error", .index = largest_at},
          Place{.letter = "B", .what = "a typical place", .index = typical}};
}

/// Around the fused and the true position, wide enough for the error and its ellipse.
Panel MakeNearPanel(const DriveReport& report, const Place& place, cv::Rect2d box) {
  const PosePair& pair = report.fused.evaluation->pairs[place.index];
  const auto& covariance = report.fused.evaluation->estimates[place.index].covariance;
  const Eigen::Vector2d centre = 0.5 * (Position(pair.X_WB) + Position(pair.X_WB_true));
  const double error_m = (Position(pair.X_WB) - Position(pair.X_WB_true)).norm();
  constexpr double kLeastM = 1.0;
  constexpr double kMostM = 20.0;
  const double half_height = std::clamp(
      1.8 * std::max(error_m, covariance ? HalfAxis(*covariance) : 0.0), kLeastM, kMostM);
  Range x;
  Range y;
  x.Include(centre.x());
  y.Include(centre.y());
  x.Grow(half_height);
  y.Grow(half_height);
  return EqualScales(box, x, y);
}

void DrawNear(Canvas& canvas,
              const DriveReport& report,
              const Place& place,
              const ReportColours& colours,
              const cv::Rect2d& box) {
  const Panel panel = MakeNearPanel(report, place, box);
  const PosePair& pair = report.fused.evaluation->pairs[place.index];
  const EvaluatedPose& estimate = report.fused.evaluation->estimates[place.index];
  const double error_m = (Position(pair.X_WB) - Position(pair.X_WB_true)).norm();
  DrawAxes(canvas, panel, "x [m], to scale", "");
  canvas.Within(box, [&] {
    if (estimate.covariance) {
      const Eigen::Matrix2d position = estimate.covariance->topLeftCorner<2, 2>();
      const auto ellipse = EllipsePixels(panel, ProjectToPlane(pair.X_WB), position);
      constexpr double kOpacity = 0.2;
      canvas.Translucent(kOpacity, [&] { canvas.Polygon(ellipse, colours.fused); });
      canvas.Polyline(ellipse, colours.fused, 0.8);
    }
    DrawWays(canvas,
             panel,
             report,
             colours,
             {.truth = 7.0, .odometry = 1.6, .fused = 2.0, .dot = 3.2, .outlier = 3.8});
    const cv::Point2d truth = panel.Pixel(Position(pair.X_WB_true));
    const cv::Point2d fused = panel.Pixel(Position(pair.X_WB));
    canvas.Line(truth, fused, canvas.theme().ink, 1.4);
    canvas.Dot(truth, 4.5, canvas.theme().ink);
    canvas.Dot(truth, 3.0, colours.truth);
    canvas.Dot(fused, 4.5, canvas.theme().ink);
    canvas.Dot(fused, 3.0, colours.fused);
  });
  canvas.Text(fmt::format("{}  {}: {:.2f} m at {:.1f} s",
                          place.letter,
                          place.what,
                          error_m,
                          static_cast<double>(pair.time_ns) * 1e-9),
              {box.x, box.y - 9.0},
              {0.0, 1.0},
              {.height = 14.0, .weight = 1.2},
              canvas.theme().ink);
}

/// Where the near views are on the map.
void DrawPlaceMarks(Canvas& canvas,
                    const Panel& panel,
                    const DriveReport& report,
                    const std::array<Place, 2>& places) {
  for (const Place& place : places) {
    const cv::Point2d at =
        panel.Pixel(Position(report.fused.evaluation->pairs[place.index].X_WB_true));
    const cv::Point2d label = at + cv::Point2d(0.0, -22.0);
    canvas.Line(at, label, canvas.theme().ink, 1.0);
    canvas.Dot(label, 9.0, canvas.theme().ink);
    canvas.Text(place.letter,
                label,
                {0.5, 0.5},
                {.height = 12.0, .weight = 1.2},
                canvas.theme().background);
  }
}

}  // namespace

Result<TopView> ReadTopView(const std::string& path, const std::array<double, 4>& extent_m) {
  TopView view;
  view.picture = cv::imread(path, cv::IMREAD_COLOR);
  if (view.picture.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: cannot be read as a picture, must be a PNG or JPEG", path)};
  }
  const auto [left, bottom, right, top] = extent_m;
  if (!(right > left) || !(top > bottom)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--top-view-extent is {},{},{},{}, must be left,bottom,right,top in m "
                             "with left < right and bottom < top",
                             left,
                             bottom,
                             right,
                             top)};
  }
  view.x = {.low = left, .high = right};
  view.y = {.low = bottom, .high = top};
  return view;
}

cv::Mat DrawDrive(const DriveReport& report, const TopView& top_view, const FigureStyle& style) {
  const ReportColours& colours = style.colours;
  const Panel map = MakeMapPanel(report);
  const double near_top = map.box.br().y + kBetween;
  Canvas canvas(kWidth, near_top + kNearHeight + kBottom, style.theme, kPixelsPerUnit);
  const Evaluation& fused = *report.fused.evaluation;
  const EllipseChoice ellipses =
      fused.coverage.position_count > 0 ? ChooseEllipses(map, fused) : EllipseChoice();
  const std::array<Place, 2> places = ChoosePlaces(report);

  canvas.Text(report.title,
              {kLeft, 16.0},
              {0.0, 0.5},
              {.height = canvas.HeightToFit(report.title, 17.0, kPanelWidth), .weight = 1.4},
              canvas.theme().ink);
  const std::string outcome = DescribeOutcome(report);
  canvas.Text(outcome, {kLeft, 42.0}, {0.0, 0.5}, canvas.HeightToFit(outcome, 11.0, kPanelWidth));
  DrawTopView(canvas, map, top_view);
  DrawAxes(canvas, map, "x of the map [m]", "y of the map [m]");
  DrawLegend(canvas, map, report, colours, ellipses);
  canvas.Within(map.box, [&] {
    if (ellipses.every_m > 0.0) DrawEllipses(canvas, map, fused, ellipses, colours.fused);
    DrawWays(canvas, map, report, colours, {});
    DrawPlaceMarks(canvas, map, report, places);
    DrawMarks(canvas, map, report);
    DrawScale(canvas, map);
  });
  const double near_width = 0.5 * (kPanelWidth - kNearGap);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double x = kLeft + static_cast<double>(i) * (near_width + kNearGap);
    DrawNear(canvas, report, places.at(i), colours, {x, near_top, near_width, kNearHeight});
  }
  return canvas.Finish();
}

}  // namespace relocd
