#include "engine/dem/statistics/statistics_pages.h"

#include <iterator>
#include <utility>

namespace terrace::dem {

bool StatisticsPages::Admit(std::size_t bytes) {
  const std::lock_guard lock(mutex_);
  if (bytes > kept_left_) return false;
  kept_left_ -= bytes;
  return true;
}

StatisticsPages::Tables StatisticsPages::Find(const void* raster) {
  const std::lock_guard lock(mutex_);
  const auto found = by_raster_.find(raster);
  if (found == by_raster_.end()) return nullptr;
  pages_.splice(pages_.begin(), pages_, found->second);
  return found->second->tables;
}

void StatisticsPages::Add(const void* raster, Tables tables) {
  const std::size_t bytes = tables->bytes();
  const std::lock_guard lock(mutex_);
  if (by_raster_.contains(raster)) return;  // added by another thread meanwhile
  pages_.push_front({raster, std::move(tables), bytes});
  by_raster_.emplace(raster, pages_.begin());
  paged_ += bytes;
  while (paged_ > most_paged_ && pages_.size() > 1) Remove(std::prev(pages_.end()));
}

void StatisticsPages::Forget(const void* raster) {
  const std::lock_guard lock(mutex_);
  if (const auto found = by_raster_.find(raster); found != by_raster_.end()) Remove(found->second);
}

std::size_t StatisticsPages::paged_bytes() const {
  const std::lock_guard lock(mutex_);
  return paged_;
}

void StatisticsPages::Remove(std::list<Page>::iterator page) {
  paged_ -= page->bytes;
  by_raster_.erase(page->raster);
  pages_.erase(page);
}

}  // namespace terrace::dem
