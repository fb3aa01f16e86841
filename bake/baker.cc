#include "bake/baker.h"

#include <xxhash.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <list>
#include <mutex>
#include <new>
#include <optional>
#include <thread>
#include <utility>

#include "archive/unit_name.h"
#include "bake/bake_request.h"
#include "bake/copy_unit.h"
#include "bake/queue/local_queue.h"
#include "bake/unit_key.h"
#include "engine/core/elapsed_time.h"

namespace terrace::bake {
namespace {

using Clock = std::chrono::steady_clock;

// What a thread of the bake throws becomes the error of its unit: without memory, or if the statistics of a source
// cannot be read, the units of the others go on.
template <typename Work>
auto CatchErrors(const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return tl::unexpected(Error{ErrorCode::kUnavailable, "no memory"});  // short: needs none itself
  } catch (const ThrownError& thrown) {
    return tl::unexpected(thrown.error());
  } catch (const std::exception& thrown) {
    return MakeError(ErrorCode::kUnavailable, "{}", thrown.what());
  }
}

// A unit that is being baked.
class OpenUnit {
 public:
  struct Output {
    std::size_t target = 0;
    std::uint64_t key = 0;
    std::unique_ptr<archive::UnitWriter> writer = {};
    std::unique_ptr<std::mutex> mutex = std::make_unique<std::mutex>();  // of the writer
  };

  std::size_t index = 0;  // in the plan
  std::vector<Output> outputs;
  Clock::time_point start = Clock::now();
  // Guarded by Run::mutex_.
  std::deque<Part> parts;  // not begun
  int under_way = 0;       // parts
  std::optional<Error> error;
};

class Run {
 public:
  Run(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets, const UnitPlan& plan, UnitQueue& queue,
      const BakeOptions& options, Counters& counters)
      : pipeline_(pipeline),
        dataset_(pipeline.datasets().front()),
        targets_(targets),
        plan_(plan),
        queue_(queue),
        options_(options),
        counters_(counters),
        reports_(plan.units.size()),
        is_tried_again_(plan.units.size()) {}

  std::vector<UnitReport> Execute() {
    {
      const std::stop_callback wake(options_.stop, [this] {
        const std::lock_guard lock(mutex_);
        TellOthers();
      });
      std::vector<std::jthread> threads;
      for (unsigned i = 0; i < options_.threads; ++i) threads.emplace_back([this] { Work(); });
    }
    std::vector<UnitReport> all;
    for (auto& of_unit : reports_) std::ranges::move(of_unit, std::back_inserter(all));
    return all;
  }

 private:
  using UnitPtr = std::shared_ptr<OpenUnit>;

  // A thread opens units of its own as long as there are any, so that threads do not decode the same blocks. Then it
  // takes parts of the others' units.
  void Work() {
    UnitPtr own;
    while (!options_.stop.stop_requested()) {
      std::unique_lock lock(mutex_);
      if (own && own->parts.empty()) own = nullptr;
      UnitPtr unit = own;
      UnitQueue::Taken taken;
      const std::uint64_t seen = changes_;
      if (!unit) {
        lock.unlock();
        taken = queue_.Take();
        if (taken.state == UnitQueue::Taken::State::kUnit) own = Open(taken);
        lock.lock();
        if (own) {
          open_.push_back(own);
          TellOthers();
        }
        if (taken.state == UnitQueue::Taken::State::kUnit) continue;
        unit = UnitToHelp();
      }
      if (!unit) {
        if (taken.state == UnitQueue::Taken::State::kOver && open_.empty()) {
          TellOthers();  // they need not wait
          return;
        }
        // A shared queue may hand out units again that other processes gave back; nothing notifies this one.
        constexpr std::chrono::milliseconds kPause{200};
        changed_.wait_for(lock, kPause, [&] { return changes_ != seen || options_.stop.stop_requested(); });
        continue;
      }
      // The owner begins at the front, helpers at the back: far from each other.
      Part part;
      if (unit == own) {
        part = unit->parts.front();
        unit->parts.pop_front();
      } else {
        part = unit->parts.back();
        unit->parts.pop_back();
      }
      ++unit->under_way;
      lock.unlock();
      const Result<void> done = CatchErrors([&] { return BakePart(*unit, part); });
      lock.lock();
      --unit->under_way;
      if (!done) {
        unit->parts.clear();
        if (!unit->error) unit->error = done.error();
      }
      if (!unit->parts.empty() || unit->under_way > 0) continue;
      lock.unlock();
      Close(*unit);
      lock.lock();
      open_.remove(unit);
      TellOthers();
    }
  }

  // Wakes the threads that wait. The caller holds the lock.
  void TellOthers() {
    ++changes_;
    changed_.notify_all();
  }

  UnitPtr UnitToHelp() const {
    const auto most = std::ranges::max_element(open_, {}, [](const UnitPtr& unit) { return unit->parts.size(); });
    return most == open_.end() || (*most)->parts.empty() ? nullptr : *most;
  }

  // Finds which files of the unit are there; creates the others. Null: nothing is left to do, or it failed.
  UnitPtr Open(const UnitQueue::Taken& taken) {
    const std::size_t index = taken.unit;
    const UnitPlan::Entry& entry = plan_.units[index];
    Forget(index);
    WaitBefore(taken.attempt);
    auto unit = std::make_shared<OpenUnit>();
    unit->index = index;
    for (const std::size_t target : entry.targets) {
      if (options_.stop.stop_requested()) {
        queue_.Return(index);
        return nullptr;
      }
      if (HasReport(index, target)) continue;
      OpenUnit::Output output{target};
      const Result<bool> is_to_do = CatchErrors([&] { return OpenOutput(index, output); });
      if (is_to_do && !*is_to_do) continue;
      if (!is_to_do) unit->error = is_to_do.error();
      unit->outputs.push_back(std::move(output));
    }
    if (unit->error) {
      Close(*unit);
      return nullptr;
    }
    if (unit->outputs.empty()) {
      queue_.Done(index);
      return nullptr;
    }
    for (const Part& part : PartsOf(entry.unit)) unit->parts.push_back(part);
    return unit;
  }

  // Creates the file of a target. False: it is there already, or is reported as missing or unusable.
  Result<bool> OpenOutput(std::size_t index, OpenUnit::Output& output) {
    const Unit& unit = plan_.units[index].unit;
    const Target& to = targets_[output.target];
    output.key = UnitKey(dataset_, to.manifest, unit);
    if (!to.create) {
      const Result<void> taken = TakeFinished(index, output.target, output.key);
      if (taken) return false;
      if (options_.only_verify) {
        const bool is_missing = taken.error().code == ErrorCode::kNotFound;
        Report(index, {output.target,
                       {unit.name, output.key, 0, 0, {}},
                       is_missing ? UnitOutcome::kMissing : UnitOutcome::kUnusable,
                       0,
                       is_missing ? std::string() : taken.error().message});
        return false;
      }
    }
    auto writer = to.create ? to.create() : archive::CreateUnit(to.place, unit.name, {to.manifest.kind, output.key});
    if (!writer) return tl::unexpected(writer.error());
    output.writer = *std::move(writer);
    return true;
  }

  // A full disk or an unreachable file server may recover.
  void WaitBefore(int attempt) {
    if (attempt == 0) return;
    constexpr std::chrono::milliseconds kPause{500};
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any().wait_for(lock, options_.stop, kPause * attempt, [] { return false; });
  }

  // Takes a file that exists with this key, or copies one from the old archive. kNotFound: there is no file. Other
  // errors: it is not the unit's.
  Result<void> TakeFinished(std::size_t index, std::size_t target, std::uint64_t key) {
    const Clock::time_point start = Clock::now();
    const Target& to = targets_[target];
    const std::string& name = plan_.units[index].unit.name;
    UnitOutcome outcome = UnitOutcome::kKept;
    auto unit_file = archive::VerifyUnit(to.place, name, {to.manifest.kind, key});
    if (unit_file && unit_file->tiles != CountTiles(plan_.units[index].unit.tiles)) {
      unit_file = MakeError(ErrorCode::kInvalidArgument, "{}/{} lacks tiles", to.place, archive::UnitPath(name));
    }
    const auto old = to.old_units.find(name);
    if (!unit_file && old != to.old_units.end() && old->second.key == key && !options_.only_verify) {
      outcome = UnitOutcome::kCopied;
      unit_file = CopyUnit(to.old_place, to.place, old->second);
    }
    if (!unit_file) return tl::unexpected(std::move(unit_file.error()));
    counters_.skipped += unit_file->tiles;
    Report(
        index,
        {target, {name, key, unit_file->tiles, unit_file->bytes, unit_file->xxh3}, outcome, SecondsSince(start), {}});
    return {};
  }

  Result<void> BakePart(OpenUnit& unit, const Part& part) {
    Result<void> done;
    Walk(plan_.units[unit.index].unit.tiles, part, [&](const geo::TileKey& key) {
      done = BakeTile(unit, key);
      return done.has_value();
    });
    return done;
  }

  Result<void> BakeTile(OpenUnit& unit, const geo::TileKey& key) {
    std::optional<dem::HeightRange> range;
    for (OpenUnit::Output& output : unit.outputs) {
      const Target& to = targets_[output.target];
      const tiler::TileRequest request = RequestOf(to.manifest, key);
      if (to.has && to.has(request)) {
        ++counters_.skipped;
        continue;
      }
      const Result<tiler::EncodedTile> tile = pipeline_.Build(request, options_.stop);
      if (!tile) return tl::unexpected(tile.error());
      if (!range) {
        range = request.format == tiler::TileFormat::kHeightPng ? dem::HeightRange() : dataset_.model->RangeBound(key);
      }
      {
        const std::lock_guard lock(*output.mutex);
        if (auto added = output.writer->Add(key, *tile, *range); !added) return added;
      }
      ++counters_.tiles;
      counters_.bytes += tile->bytes.size();
      counters_.read += static_cast<std::uint64_t>(tile->times.read.count());
      counters_.refine += static_cast<std::uint64_t>(tile->times.refine.count());
      counters_.encode += static_cast<std::uint64_t>(tile->times.encode.count());
      counters_.compress += static_cast<std::uint64_t>(tile->times.compress.count());
    }
    return {};
  }

  // After the last part: finishes the files, or drops them.
  void Close(OpenUnit& unit) {
    const std::string& name = plan_.units[unit.index].unit.name;
    for (OpenUnit::Output& output : unit.outputs) {
      if (unit.error || options_.stop.stop_requested()) {
        output.writer = nullptr;  // removes its file
        continue;
      }
      auto unit_file = CatchErrors([&] { return output.writer->Finish(); });
      output.writer = nullptr;
      if (!unit_file) {
        unit.error = unit_file.error();
        continue;
      }
      Report(unit.index, {output.target,
                          {name, output.key, unit_file->tiles, unit_file->bytes, unit_file->xxh3},
                          UnitOutcome::kBaked,
                          SecondsSince(unit.start),
                          {}});
    }
    if (options_.stop.stop_requested()) return queue_.Return(unit.index);
    if (!unit.error) return queue_.Done(unit.index);
    {
      const std::lock_guard lock(mutex_);
      is_tried_again_[unit.index] = true;
    }
    if (queue_.Fail(unit.index, *unit.error)) return;
    const std::lock_guard lock(mutex_);
    is_tried_again_[unit.index] = false;
    for (OpenUnit::Output& output : unit.outputs) {
      if (HasReportLocked(unit.index, output.target)) continue;
      ReportLocked(unit.index, {output.target,
                                {name, output.key, 0, 0, {}},
                                UnitOutcome::kFailed,
                                SecondsSince(unit.start),
                                unit.error->message});
    }
  }

  // A unit that is handed out anew is done from the beginning, unless its last attempt failed here: then the files that
  // were written stay.
  void Forget(std::size_t index) {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_tried_again_[index], false)) return;
    counters_.units -= reports_[index].size();
    reports_[index].clear();
  }
  bool HasReportLocked(std::size_t index, std::size_t target) const {
    return std::ranges::find(reports_[index], target, &UnitReport::target) != reports_[index].end();
  }
  bool HasReport(std::size_t index, std::size_t target) {
    const std::lock_guard lock(mutex_);
    return HasReportLocked(index, target);
  }
  void ReportLocked(std::size_t index, UnitReport report) {
    ++counters_.units;
    if (options_.on_unit) options_.on_unit(report);
    reports_[index].push_back(std::move(report));
  }
  void Report(std::size_t index, UnitReport report) {
    const std::lock_guard lock(mutex_);
    ReportLocked(index, std::move(report));
  }

  const tiler::TilePipeline& pipeline_;
  const tiler::Dataset& dataset_;
  const std::vector<Target>& targets_;
  const UnitPlan& plan_;
  UnitQueue& queue_;
  const BakeOptions& options_;
  Counters& counters_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t changes_ = 0;  // so that none is missed between Take, which needs no lock, and waiting
  std::list<UnitPtr> open_;
  std::vector<std::vector<UnitReport>> reports_;  // by unit
  std::vector<char> is_tried_again_;              // by unit: its last attempt failed here
};

}  // namespace

bool Shard::Has(const std::string& unit) const {
  return count <= 1 || XXH3_64bits(unit.data(), unit.size()) % count == index;
}

UnitPlan UnitPlan::Make(const std::vector<Target>& targets, const Shard& shard) {
  UnitPlan plan;
  std::vector<bool> is_planned(targets.size());
  for (std::size_t first = 0; first < targets.size(); ++first) {
    if (is_planned[first]) continue;
    const archive::Manifest& manifest = targets[first].manifest;
    const auto is_mercator = [](const archive::Manifest& of) {
      return of.kind.format == tiler::TileFormat::kHeightPng;
    };
    std::vector<std::size_t> together;
    for (std::size_t i = first; i < targets.size(); ++i) {
      const archive::Manifest& other = targets[i].manifest;
      if (is_planned[i] || is_mercator(other) != is_mercator(manifest) || other.available != manifest.available)
        continue;
      is_planned[i] = true;
      together.push_back(i);
    }
    for (Unit& unit : UnitsOf(manifest.available)) {
      if (!shard.Has(unit.name)) continue;
      plan.tiles += CountTiles(unit.tiles) * together.size();
      plan.files += together.size();
      plan.units.push_back({std::move(unit), together});
    }
  }
  return plan;
}

std::vector<UnitReport> Bake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                             const UnitPlan& plan, const BakeOptions& options, Counters& counters) {
  LocalQueue queue(plan.units.size());
  return Bake(pipeline, targets, plan, queue, options, counters);
}

std::vector<UnitReport> Bake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                             const UnitPlan& plan, UnitQueue& queue, const BakeOptions& options, Counters& counters) {
  return Run(pipeline, targets, plan, queue, options, counters).Execute();
}

}  // namespace terrace::bake
