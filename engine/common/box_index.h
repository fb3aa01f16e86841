// An index of boxes: finds the boxes that intersect a given one.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace terrace::dem {

// In degrees, or in pixels; then y is the row.
struct Box {
  double min_x = 0, min_y = 0, max_x = 0, max_y = 0;

  void Grow(double x, double y) { min_x -= x, max_x += x, min_y -= y, max_y += y; }
};

// An R-tree. Thread-safe as long as no entries are removed. An empty index finds nothing.
class BoxIndex {
 public:
  struct Entry {
    Box box;
    std::size_t value;
  };

  BoxIndex();
  explicit BoxIndex(const std::vector<Entry>& entries);
  BoxIndex(BoxIndex&&) noexcept;
  BoxIndex& operator=(BoxIndex&&) noexcept;
  ~BoxIndex();

  // Returns the values of the entries that intersect or touch the box, ascending, without duplicates.
  std::vector<std::size_t> Find(const Box& box) const;

  // Whether Find would return any. Ends at the first.
  bool Any(const Box& box) const;

  // Removes an entry. Precondition: the index was made with it.
  void Remove(const Entry& entry);

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace terrace::dem
