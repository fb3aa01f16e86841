#include "engine/tin/greedy.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/data_dependent.h"
#include "engine/tin/insertion_recorder.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/triangulation.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/scan/squared_errors.h"
#include "engine/tin/scan/triangle_scan.h"
#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {
namespace {

// The position of a run within its seed grids: the samples that are due, in order.
class SeedCursor {
 public:
  // Fails a TERRACE_CHECK if a step does not divide both sides, or if the grids are not in order of decreasing
  // below_error.
  SeedCursor(const HeightField& field, std::vector<SeedGrid> grids)
      : width_(field.width()), height_(field.height()), grids_(std::move(grids)) {
    for (std::size_t i = 0; i < grids_.size(); ++i) {
      const int step = grids_[i].step;
      TERRACE_CHECK(step > 0 && (width_ - 1) % step == 0 && (height_ - 1) % step == 0);
      TERRACE_CHECK(i == 0 || grids_[i - 1].below_error >= grids_[i].below_error);
    }
  }

  // Whether a grid is unfinished. Its remaining samples are inserted at any error.
  bool InGrid() const { return begun_; }
  bool HasGrid() const { return grid_ < grids_.size(); }
  // Whether the next grid must be in every mesh with this error. Precondition: HasGrid.
  bool IsDue(double error) const { return static_cast<double>(below_error()) > error; }
  // The below_error of the grid that holds the next sample, rounded up to a float.
  float below_error() const { return CandidateQueue::RoundUp(grids_[grid_].below_error); }

  // The next sample, row by row. Precondition: HasGrid.
  SamplePosition Take() {
    const SamplePosition sample{static_cast<std::uint16_t>(x_), static_cast<std::uint16_t>(y_)};
    const int step = grids_[grid_].step;
    begun_ = true;
    x_ += step;
    if (x_ < width_) return sample;
    x_ = 0;
    y_ += step;
    if (y_ < height_) return sample;
    y_ = 0;
    begun_ = false;
    ++grid_;
    return sample;
  }

 private:
  int width_, height_;
  std::vector<SeedGrid> grids_;
  std::size_t grid_ = 0;
  bool begun_ = false;
  int x_ = 0, y_ = 0;
};

// Insertions between two checks of the stop token: about a twentieth of a millisecond.
constexpr std::size_t kStopPeriod = 256;

void CheckOptions(const GreedyOptions& options) {
  for (const BorderOptions& border : options.borders) {
    for (const double value : {border.weight, border.padding_m, border.step_m, border.sagitta_m, border.scale}) {
      TERRACE_CHECK(std::isfinite(value) && value >= 0);
    }
  }
}

std::size_t CountValid(const HeightField& field) {
  std::size_t valid = 0;
  for (int y = 0; y < field.height(); ++y) {
    valid += static_cast<std::size_t>(
        std::count_if(field.Row(y), field.Row(y) + field.width(), [](float value) { return !std::isnan(value); }));
  }
  return valid;
}

}  // namespace

class GreedyTriangulation::Impl {
 public:
  Impl(const HeightField& field, GreedyOptions options);
  Impl(const HeightField& field, GreedyOptions options, const Refinement& refinement);

  bool Run(const GreedyGoal& goal, const std::stop_token& stop);
  double CurrentError();
  std::size_t vertex_count() const { return triangulation_.vertex_count(); }
  TinMesh Mesh() const { return triangulation_.Mesh(); }
  std::optional<Refinement> MakeRefinement() const;

 private:
  struct Insertion {
    SamplePosition sample;
    TriangleId triangle;  // contains the sample
    float error_before;   // a run to this error ends before this insertion
    bool is_seed;
  };
  std::optional<Insertion> NextInsertion(const GreedyGoal& goal);
  std::optional<Insertion> NextSeed(const GreedyGoal& goal);
  void PrefetchUpcoming() const;
  bool IsMet(const GreedyGoal& goal);
  bool IsRmsMet(const GreedyGoal& goal);
  void Insert(const Insertion& insertion);
  const Star& Insert(const Triangulation::Vertex& vertex, TriangleId triangle);

  Triangulation::Vertex VertexOf(SamplePosition sample) const;
  const PlaneMisfit* ScanOf(const Star& star);
  void ScanStarOf(const Star& star);
  void AwaitScan(TriangleId t);
  void ScanAwaiting();
  Candidate CandidateOf(const Star& star, std::size_t i, const PlaneMisfit& misfit);
  bool MayBeLimited(const Star& star, std::size_t i) const;
  Candidate WorstLimitedOf(TriangleId t) const;
  Candidate WorstOnBorderOf(TriangleId t);
  Candidate WorstOnBorder(VertexId from, VertexId to);
  double SquaresOf(TriangleId t) const;
  Corner CornerAt(VertexId vertex) const;
  void MakeStar(TriangleId t, Star& star) const;

  const HeightField* field_;
  GreedyOptions options_;
  BoundingBox limited_;  // samples with limits of their own
  Sagitta sagitta_;
  SeedCursor seeds_;
  Triangulation triangulation_;
  TriangleId last_changed_ = 0;  // where walks start
  CandidateQueue candidates_;    // by triangle
  std::optional<DataDependentCriterion> data_dependent_;
  std::optional<InsertionRecorder> recorder_;

  // Triangles with outdated candidates. While seeds are inserted, they accumulate and are scanned only if they remain.
  std::vector<TriangleId> awaiting_scan_;
  std::vector<std::uint8_t> awaits_scan_;  // by triangle

  // The worst sample of each border edge, by side and the first position of the edge. Zeros, because initializing
  // Candidates took a twentieth of the time of a tile of four vertices.
  struct BorderWorst {
    double error;
    std::uint32_t sample;
    std::uint32_t end;  // of the edge; 0: none
  };
  std::array<std::unique_ptr<BorderWorst[]>, 4> border_worst_;

  std::optional<SquaredErrors> squares_;  // by triangle; from the first root-mean-square goal on
  std::size_t valid_samples_ = 0;         // counted with it

  // Of the star that is being scanned.
  StarScan scan_star_ = BestStarScan();
  std::vector<PlaneMisfit> misfits_;
  Star lone_star_;  // of a triangle that awaited its scan
};

GreedyTriangulation::Impl::Impl(const HeightField& field, GreedyOptions options)
    : field_(&field),
      options_(std::move(options)),
      sagitta_(options_.curvature, field.height()),
      seeds_(field, options_.seeds),
      triangulation_(field),
      candidates_(2 * Triangulation::LikelyVertices(field)) {
  CheckOptions(options_);
  if (!options_.limits.empty()) limited_ = BoxOfLimits(options_.limits, field.width(), field.height());
  for (const Side side : {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest}) {
    const bool along_x = side == Side::kSouth || side == Side::kNorth;
    border_worst_[static_cast<std::size_t>(side)] =
        std::make_unique<BorderWorst[]>(static_cast<std::size_t>(along_x ? field.width() : field.height()));
  }
  if (options_.criterion == Criterion::kDataDependent) {
    data_dependent_.emplace(field, sagitta_, triangulation_, options_.data_dependent);
  }
  if (options_.record) recorder_.emplace(Triangulation::LikelyVertices(field));
  AwaitScan(0);
  AwaitScan(1);
}

GreedyTriangulation::Impl::Impl(const HeightField& field, GreedyOptions options, const Refinement& refinement)
    : Impl(field, std::move(options)) {
  TERRACE_CHECK(refinement.width() == field.width() && refinement.height() == field.height());
  const TinMesh mesh = refinement.MeshOf(refinement.vertex_count());
  std::vector<Triangulation::Vertex> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const SamplePosition sample : mesh.vertices) {
    vertices.push_back(VertexOf(sample));
  }
  triangulation_ = Triangulation(std::move(vertices), mesh.triangles);
  // NextSeed starts again at the first grid. Grids that the mesh already has are due at once; their samples are
  // skipped, because they are vertices.
  if (recorder_) recorder_.emplace(refinement);
  for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) AwaitScan(t);
}

bool GreedyTriangulation::Impl::Run(const GreedyGoal& goal, const std::stop_token& stop) {
  for (std::size_t count = 0;; ++count) {
    if (count % kStopPeriod == 0 && stop.stop_requested()) return false;
    const std::optional<Insertion> next = NextInsertion(goal);
    if (!next) return true;
    Insert(*next);
  }
}

// A run to a coarser error has to be a prefix of a run to a finer one. A seed grid belongs to every mesh whose error is
// below the grid's, so it is due when its below_error exceeds both the current and the requested error.
std::optional<GreedyTriangulation::Impl::Insertion> GreedyTriangulation::Impl::NextInsertion(const GreedyGoal& goal) {
  if (IsMet(goal)) return std::nullopt;
  if (seeds_.HasGrid()) {
    if (const auto seed = NextSeed(goal)) return seed;
  }
  if (!awaiting_scan_.empty()) ScanAwaiting();
  const TriangleId worst = candidates_.Winner();
  if (worst == CandidateQueue::kNoSlot) return std::nullopt;
  PrefetchUpcoming();
  const float error = candidates_.error(worst);
  if (static_cast<double>(error) <= goal.max_error) return std::nullopt;
  return Insertion{PositionOf(candidates_.sample(worst)), worst, error, false};
}

// The next insertion may be anywhere in memory: prefetches it during this one. In two steps, because the second reads
// data of the first; in one step as long as most triangles are in the second-level cache.
void GreedyTriangulation::Impl::PrefetchUpcoming() const {
  constexpr std::size_t kFewTriangles = std::size_t{1} << 14;
  const auto upcoming = [this](std::size_t ahead, auto&& prefetch) {
    if (const TriangleId t = candidates_.Upcoming(ahead); t != CandidateQueue::kNoSlot) prefetch(t);
  };
  const bool are_many = triangulation_.triangle_count() > kFewTriangles;
  upcoming(are_many ? 3 : 1, [this](TriangleId t) { triangulation_.PrefetchAround(t); });
  if (are_many) upcoming(1, [this](TriangleId t) { triangulation_.PrefetchBeyond(t); });
}

std::optional<GreedyTriangulation::Impl::Insertion> GreedyTriangulation::Impl::NextSeed(const GreedyGoal& goal) {
  while (seeds_.InGrid() || (seeds_.HasGrid() && seeds_.IsDue(std::max(CurrentError(), goal.max_error)))) {
    const float below_error = seeds_.below_error();
    const SamplePosition seed = seeds_.Take();
    const TriangleId triangle = triangulation_.Locate(seed, last_changed_);
    if (!triangulation_.IsCorner(seed, triangle)) return Insertion{seed, triangle, below_error, true};
  }
  return std::nullopt;
}

bool GreedyTriangulation::Impl::IsMet(const GreedyGoal& goal) {
  return vertex_count() >= goal.max_points || (goal.rms_error > 0 && IsRmsMet(goal));
}

bool GreedyTriangulation::Impl::IsRmsMet(const GreedyGoal& goal) {
  if (!squares_) {
    squares_.emplace();
    valid_samples_ = CountValid(*field_);
    for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) AwaitScan(t);
  }
  ScanAwaiting();
  return squares_->Total() <= goal.rms_error * goal.rms_error * static_cast<double>(valid_samples_);
}

void GreedyTriangulation::Impl::Insert(const Insertion& insertion) {
  const Triangulation::Vertex vertex = VertexOf(insertion.sample);
  const Star& star = Insert(vertex, insertion.triangle);
  if (recorder_) recorder_->Append(insertion.sample, insertion.error_before, star);
  last_changed_ = star.triangles[0];
  if (insertion.is_seed || squares_) {
    for (std::size_t i = 0; i < star.count; ++i) AwaitScan(star.triangles[i]);
  } else {
    ScanStarOf(star);
  }
}

const Star& GreedyTriangulation::Impl::Insert(const Triangulation::Vertex& vertex, TriangleId triangle) {
  return data_dependent_ ? data_dependent_->Insert(vertex, triangle) : triangulation_.InsertDelaunay(vertex, triangle);
}

double GreedyTriangulation::Impl::CurrentError() {
  ScanAwaiting();
  const TriangleId worst = candidates_.Winner();
  return worst == CandidateQueue::kNoSlot ? 0 : static_cast<double>(candidates_.error(worst));
}

std::optional<Refinement> GreedyTriangulation::Impl::MakeRefinement() const {
  TERRACE_CHECK(recorder_.has_value());
  return recorder_->Make(field_->width(), field_->height());
}

Triangulation::Vertex GreedyTriangulation::Impl::VertexOf(SamplePosition sample) const {
  return Triangulation::VertexAt(*field_, sample.x, sample.y);
}

const PlaneMisfit* GreedyTriangulation::Impl::ScanOf(const Star& star) {
  if (data_dependent_) return data_dependent_->Scan(star);
  if (misfits_.size() < star.count) misfits_.resize(star.ring.capacity());
  scan_star_(*field_, star, misfits_.data());
  return misfits_.data();
}

void GreedyTriangulation::Impl::ScanStarOf(const Star& star) {
  const PlaneMisfit* const misfits = ScanOf(star);
  candidates_.Reserve(triangulation_.triangle_count());
  const bool is_plain = sagitta_.is_flat() && !star.has_border && options_.limits.empty();
  const std::uint32_t* const slots = star.triangles.data();
  if (is_plain) {
    candidates_.SetAll(slots, star.count, [misfits](std::size_t i) {
      return Candidate{DistanceOrZero(misfits[i]), misfits[i].sample};
    });
  } else {
    candidates_.SetAll(slots, star.count, [&](std::size_t i) { return CandidateOf(star, i, misfits[i]); });
  }
}

void GreedyTriangulation::Impl::AwaitScan(TriangleId t) {
  if (t >= awaits_scan_.size()) awaits_scan_.resize(t + std::size_t{1}, 0);
  if (awaits_scan_[t]) return;
  awaits_scan_[t] = 1;
  awaiting_scan_.push_back(t);
}

// Each triangle as a star of its own around its last corner: the centre of the star that made it.
void GreedyTriangulation::Impl::ScanAwaiting() {
  for (const TriangleId t : awaiting_scan_) {
    MakeStar(t, lone_star_);
    ScanStarOf(lone_star_);
    if (squares_) squares_->Set(t, SquaresOf(t));
    awaits_scan_[t] = 0;
  }
  awaiting_scan_.clear();
}

void GreedyTriangulation::Impl::MakeStar(TriangleId t, Star& star) const {
  const auto [u, v, p] = triangulation_.triangle(t);
  const SamplePosition centre = triangulation_.position(p);
  star.centre = p;
  star.x = centre.x;
  star.y = centre.y;
  star.height = triangulation_.height(p);
  star.is_closed = false;
  star.has_border = true;  // perhaps; borders are checked
  star.count = 1;
  if (star.triangles.empty()) {
    star.ring.Grow(2);
    star.triangles.resize(1);
    star.outside.resize(1);
  }
  star.triangles[0] = t;
  star.outside[0] = triangulation_.twin(4 * t);
  star.ring.Put(0, triangulation_.Seen(u, centre));
  star.ring.Put(1, triangulation_.Seen(v, centre));
}

Candidate GreedyTriangulation::Impl::CandidateOf(const Star& star, std::size_t i, const PlaneMisfit& misfit) {
  Candidate worst;
  if (!options_.limits.empty() && MayBeLimited(star, i)) {
    worst = WorstLimitedOf(star.triangles[i]);
  } else if (misfit.sample != kNoSample) {
    const double sagitta =
        sagitta_.Bound(triangulation_.position(star.ring.ids[i]), triangulation_.position(star.ring.ids[i + 1]),
                       {static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)});
    worst = {misfit.distance + sagitta, misfit.sample};
  }
  if (star.has_border) {
    const Candidate on_border = WorstOnBorderOf(star.triangles[i]);
    if (Precedes(on_border, worst)) worst = on_border;
  }
  return worst;
}

bool GreedyTriangulation::Impl::MayBeLimited(const Star& star, std::size_t i) const {
  const RingVertex u = star.ring[i], v = star.ring[i + 1];
  const auto [west, east] = std::minmax({0, u.dx, v.dx});
  const auto [south, north] = std::minmax({0, u.dy, v.dy});
  return star.x + west <= limited_.east && star.x + east >= limited_.west && star.y + south <= limited_.north &&
         star.y + north >= limited_.south;
}

Candidate GreedyTriangulation::Impl::WorstLimitedOf(TriangleId t) const {
  const auto [u, v, p] = triangulation_.triangle(t);
  const double sagitta =
      sagitta_.Bound(triangulation_.position(u), triangulation_.position(v), triangulation_.position(p));
  return WorstLimited(*field_, {CornerAt(u), CornerAt(v), CornerAt(p)}, sagitta, options_.limits,
                      options_.limits_scale);
}

Candidate GreedyTriangulation::Impl::WorstOnBorderOf(TriangleId t) {
  Candidate worst;
  for (HalfEdgeId edge = 4 * t; edge < 4 * t + 3; ++edge) {
    if (triangulation_.twin(edge) != Triangulation::kNone) continue;
    const Candidate candidate =
        WorstOnBorder(triangulation_.corner(edge), triangulation_.corner(Triangulation::Next(edge)));
    if (Precedes(candidate, worst)) worst = candidate;
  }
  return worst;
}

Candidate GreedyTriangulation::Impl::WorstOnBorder(VertexId from, VertexId to) {
  const Corner a = CornerAt(from), b = CornerAt(to);
  const auto side = static_cast<std::size_t>(SideOf(*field_, a, b));
  const bool along_x = a.y == b.y;
  const auto [begin, end] = along_x ? std::minmax(a.x, b.x) : std::minmax(a.y, b.y);
  BorderWorst& known = border_worst_[side][static_cast<std::size_t>(begin)];
  if (const auto edge_end = static_cast<std::uint32_t>(end); known.end != edge_end) {
    const BorderOptions& border = options_.borders[side];
    const Candidate worst = options_.limits.empty() ? WorstBorderSample(*field_, a, b, border)
                                                    : WorstLimitedBorderSample(*field_, a, b, border, options_.limits);
    known = {worst.error, worst.sample, edge_end};
  }
  return {known.error, known.sample};
}

double GreedyTriangulation::Impl::SquaresOf(TriangleId t) const {
  const auto [u, v, p] = triangulation_.triangle(t);
  const std::array<Corner, 3> corners = {CornerAt(u), CornerAt(v), CornerAt(p)};
  double squares = SquaredDistances(*field_, corners);
  for (unsigned i = 0; i < 3; ++i) {
    if (triangulation_.twin(4 * t + i) != Triangulation::kNone) continue;
    squares += SquaredBorderDistances(*field_, corners[i], corners[(i + 1) % 3]);
  }
  return squares;
}

Corner GreedyTriangulation::Impl::CornerAt(VertexId vertex) const {
  const SamplePosition position = triangulation_.position(vertex);
  return {position.x, position.y, static_cast<double>(triangulation_.height(vertex))};
}

GreedyTriangulation::GreedyTriangulation(const HeightField& field, GreedyOptions options)
    : impl_(std::make_unique<Impl>(field, std::move(options))) {}
GreedyTriangulation::GreedyTriangulation(const HeightField& field, GreedyOptions options, const Refinement& refinement)
    : impl_(std::make_unique<Impl>(field, std::move(options), refinement)) {}
GreedyTriangulation::~GreedyTriangulation() = default;
GreedyTriangulation::GreedyTriangulation(GreedyTriangulation&&) noexcept = default;
GreedyTriangulation& GreedyTriangulation::operator=(GreedyTriangulation&&) noexcept = default;

bool GreedyTriangulation::Run(const GreedyGoal& goal, std::stop_token stop) { return impl_->Run(goal, stop); }
double GreedyTriangulation::CurrentError() const { return impl_->CurrentError(); }
std::size_t GreedyTriangulation::vertex_count() const { return impl_->vertex_count(); }
TinMesh GreedyTriangulation::Mesh() const { return impl_->Mesh(); }
std::optional<Refinement> GreedyTriangulation::MakeRefinement() const { return impl_->MakeRefinement(); }

}  // namespace terrace::tin
