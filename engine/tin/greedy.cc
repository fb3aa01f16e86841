#include "engine/tin/greedy.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/candidate_tournament.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/seed_cursor.h"
#include "engine/tin/squared_errors.h"
#include "engine/tin/triangle_scan.h"
#include "engine/tin/triangulation.h"

namespace terrace::tin {
namespace {

// Insertions between two looks at the stop token: about a tenth of a millisecond.
constexpr std::size_t kStopPeriod = 256;

void CheckOptions(const HeightField& field, const GreedyOptions& options) {
  for (const BorderOptions& border : options.borders) {
    TERRACE_CHECK(std::isfinite(border.weight) && border.weight >= 0);
    TERRACE_CHECK(std::isfinite(border.sagitta_m) && border.sagitta_m >= 0);
  }
  const Curvature& curvature = options.curvature;
  if (curvature.east_m2.empty()) return;
  TERRACE_CHECK(curvature.east_m2.size() == static_cast<std::size_t>(field.height()));
  TERRACE_CHECK(curvature.north_m2 > 0 && curvature.radius_m > 0);
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

  bool Run(const GreedyGoal& goal, const std::stop_token& stop);
  void InsertInterior(std::span<const SamplePosition> samples);
  double CurrentError();
  std::size_t vertex_count() const { return triangulation_.vertex_count(); }
  TinMesh Mesh() const;

 private:
  struct Insertion {
    SamplePosition sample;
    TriangleId triangle;  // contains the sample
  };
  std::optional<Insertion> NextInsertion(const GreedyGoal& goal);
  std::optional<Insertion> NextSeed(const GreedyGoal& goal);
  bool IsMet(const GreedyGoal& goal);
  void Insert(const Insertion& insertion);

  void AddVertexHeight(SamplePosition sample) { vertex_heights_.push_back(field_->VertexHeight(sample.x, sample.y)); }
  void AwaitScan(TriangleId t);
  void ScanAwaiting();
  Candidate WorstOf(TriangleId t) const;
  double SquaresOf(TriangleId t) const;
  std::array<Corner, 3> CornersOf(TriangleId t) const;
  SamplePosition PositionOf(std::uint32_t sample) const;

  const HeightField* field_;
  GreedyOptions options_;
  SeedCursor seeds_;
  Triangulation triangulation_;
  std::vector<float> vertex_heights_;
  TriangleId last_changed_ = 0;  // where walks start

  // Triangles whose candidates and squares are out of date. Seeds pile them up: a triangle is scanned once it stays.
  std::vector<TriangleId> awaiting_scan_;
  std::vector<std::uint8_t> awaits_scan_;  // by triangle
  CandidateTournament candidates_;         // by triangle

  std::optional<SquaredErrors> squares_;  // by triangle; from the first root-mean-square goal on
  std::size_t valid_samples_ = 0;         // counted with it
};

GreedyTriangulation::Impl::Impl(const HeightField& field, GreedyOptions options)
    : field_(&field),
      options_(std::move(options)),
      seeds_(field, options_.seeds),
      triangulation_(field.width(), field.height()) {
  CheckOptions(field, options_);
  for (const SamplePosition corner : triangulation_.positions()) AddVertexHeight(corner);
  AwaitScan(0);
  AwaitScan(1);
}

bool GreedyTriangulation::Impl::Run(const GreedyGoal& goal, const std::stop_token& stop) {
  for (std::size_t count = 0;; ++count) {
    if (count % kStopPeriod == 0 && stop.stop_requested()) return false;
    const std::optional<Insertion> next = NextInsertion(goal);
    if (!next) return true;
    Insert(*next);
  }
}

// Depends on the mesh alone until the goal is met: a run to a coarser error is a prefix of a run to a finer one. Hence
// seeds are due at the larger of the current and the wanted error, and not only when a sample is to be inserted.
std::optional<GreedyTriangulation::Impl::Insertion> GreedyTriangulation::Impl::NextInsertion(const GreedyGoal& goal) {
  if (IsMet(goal)) return std::nullopt;
  if (const auto seed = NextSeed(goal)) return seed;
  ScanAwaiting();
  const TriangleId worst = candidates_.Winner();
  const Candidate& candidate = candidates_.At(worst);
  if (candidate.error <= goal.max_error) return std::nullopt;
  return Insertion{PositionOf(candidate.sample), worst};
}

std::optional<GreedyTriangulation::Impl::Insertion> GreedyTriangulation::Impl::NextSeed(const GreedyGoal& goal) {
  while (seeds_.InGrid() || (seeds_.HasGrid() && seeds_.IsDue(std::max(CurrentError(), goal.max_error)))) {
    const SamplePosition seed = seeds_.Take();
    const TriangleId triangle = triangulation_.Locate(seed, last_changed_);
    if (!triangulation_.IsCorner(seed, triangle)) return Insertion{seed, triangle};
  }
  return std::nullopt;
}

bool GreedyTriangulation::Impl::IsMet(const GreedyGoal& goal) {
  if (vertex_count() >= goal.max_points) return true;
  if (!(goal.rms_error > 0)) return false;
  if (!squares_) {
    squares_.emplace();
    valid_samples_ = CountValid(*field_);
    for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) AwaitScan(t);
  }
  ScanAwaiting();
  return squares_->Total() <= goal.rms_error * goal.rms_error * static_cast<double>(valid_samples_);
}

void GreedyTriangulation::Impl::Insert(const Insertion& insertion) {
  for (const TriangleId t : triangulation_.Insert(insertion.sample, insertion.triangle)) {
    AwaitScan(t);
    last_changed_ = t;
  }
  AddVertexHeight(insertion.sample);
}

void GreedyTriangulation::Impl::InsertInterior(std::span<const SamplePosition> samples) {
  for (const SamplePosition sample : samples) {
    TERRACE_CHECK(sample.x > 0 && sample.x < field_->width() - 1 && sample.y > 0 && sample.y < field_->height() - 1);
    const TriangleId triangle = triangulation_.Locate(sample, last_changed_);
    if (!triangulation_.IsCorner(sample, triangle)) Insert({sample, triangle});
  }
}

double GreedyTriangulation::Impl::CurrentError() {
  ScanAwaiting();
  return candidates_.At(candidates_.Winner()).error;
}

TinMesh GreedyTriangulation::Impl::Mesh() const {
  TinMesh mesh;
  mesh.vertices = triangulation_.positions();
  mesh.triangles.reserve(triangulation_.triangle_count());
  for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) mesh.triangles.push_back(triangulation_.triangle(t));
  return mesh;
}

void GreedyTriangulation::Impl::AwaitScan(TriangleId t) {
  if (t >= awaits_scan_.size()) awaits_scan_.resize(t + std::size_t{1}, 0);
  if (awaits_scan_[t]) return;
  awaits_scan_[t] = 1;
  awaiting_scan_.push_back(t);
}

void GreedyTriangulation::Impl::ScanAwaiting() {
  for (const TriangleId t : awaiting_scan_) {
    candidates_.Set(t, WorstOf(t));
    if (squares_) squares_->Set(t, SquaresOf(t));
    awaits_scan_[t] = 0;
  }
  awaiting_scan_.clear();
}

Candidate GreedyTriangulation::Impl::WorstOf(TriangleId t) const {
  const std::array<Corner, 3> corners = CornersOf(t);
  Candidate worst;
  if (const PlaneMisfit misfit = WorstSample(*field_, corners); misfit.sample != kNoSample) {
    const double error = misfit.distance + SagittaBound(options_.curvature, corners);
    if (error > 0) worst = {error, misfit.sample};
  }
  for (unsigned i = 0; i < 3; ++i) {
    if (triangulation_.twin(3 * t + i) != Triangulation::kNone) continue;
    const Corner &a = corners[i], &b = corners[(i + 1) % 3];
    const auto side = static_cast<std::size_t>(SideOf(*field_, a, b));
    const Candidate on_border = WorstBorderSample(*field_, a, b, options_.borders[side]);
    if (Precedes(on_border, worst)) worst = on_border;
  }
  return worst;
}

double GreedyTriangulation::Impl::SquaresOf(TriangleId t) const {
  const std::array<Corner, 3> corners = CornersOf(t);
  double squares = SquaredDistances(*field_, corners);
  for (unsigned i = 0; i < 3; ++i) {
    if (triangulation_.twin(3 * t + i) != Triangulation::kNone) continue;
    squares += SquaredBorderDistances(*field_, corners[i], corners[(i + 1) % 3]);
  }
  return squares;
}

std::array<Corner, 3> GreedyTriangulation::Impl::CornersOf(TriangleId t) const {
  const auto corner = [&](VertexId vertex) {
    const SamplePosition position = triangulation_.position(vertex);
    return Corner{position.x, position.y, static_cast<double>(vertex_heights_[vertex])};
  };
  const std::array<VertexId, 3> vertices = triangulation_.triangle(t);
  return {corner(vertices[0]), corner(vertices[1]), corner(vertices[2])};
}

SamplePosition GreedyTriangulation::Impl::PositionOf(std::uint32_t sample) const {
  const auto width = static_cast<std::uint32_t>(field_->width());
  return {static_cast<std::uint16_t>(sample % width), static_cast<std::uint16_t>(sample / width)};
}

GreedyTriangulation::GreedyTriangulation(const HeightField& field, GreedyOptions options)
    : impl_(std::make_unique<Impl>(field, std::move(options))) {}
GreedyTriangulation::~GreedyTriangulation() = default;
GreedyTriangulation::GreedyTriangulation(GreedyTriangulation&&) noexcept = default;
GreedyTriangulation& GreedyTriangulation::operator=(GreedyTriangulation&&) noexcept = default;

bool GreedyTriangulation::Run(const GreedyGoal& goal, std::stop_token stop) { return impl_->Run(goal, stop); }
void GreedyTriangulation::InsertInterior(std::span<const SamplePosition> samples) { impl_->InsertInterior(samples); }
double GreedyTriangulation::CurrentError() const { return impl_->CurrentError(); }
std::size_t GreedyTriangulation::vertex_count() const { return impl_->vertex_count(); }
TinMesh GreedyTriangulation::Mesh() const { return impl_->Mesh(); }

}  // namespace terrace::tin
