#include "server/cli/mesh/mesh_blocks.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "engine/tin/extended/block_joiner.h"
#include "server/cli/common/progress.h"

namespace terrace::cli {

tin::TinMesh MeshBlocks(const tin::HeightField& field, const tin::FieldCut& cut, double max_error_m,
                        const tin::GreedyOptions& options, int threads) {
  std::atomic<std::size_t> next = 0;
  std::stop_source failed;

  std::mutex mutex;  // guards everything below
  Progress progress("meshing");
  tin::BlockJoiner joiner(cut);
  std::vector<std::optional<tin::TinMesh>> waiting(cut.size());  // for an earlier block
  std::size_t done = 0;
  std::exception_ptr failure;

  const auto mesh_blocks = [&] {
    try {
      for (std::size_t i = next++; i < cut.size(); i = next++) {
        std::optional<tin::TinMesh> mesh = MeshBlock(field, cut.block(i), max_error_m, options, failed.get_token());
        if (!mesh) return;
        const std::lock_guard lock(mutex);
        waiting[i] = std::move(mesh);
        while (joiner.added() < cut.size() && waiting[joiner.added()]) {
          joiner.Add(*std::exchange(waiting[joiner.added()], std::nullopt));
        }
        progress.Update(static_cast<double>(++done) / static_cast<double>(cut.size()));
      }
    } catch (...) {
      failed.request_stop();
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    const std::size_t most = std::min(static_cast<std::size_t>(threads), cut.size());
    while (others.size() + 1 < most) others.emplace_back(mesh_blocks);
    mesh_blocks();
  }
  if (failure) std::rethrow_exception(failure);
  return std::move(joiner).Take();
}

}  // namespace terrace::cli
