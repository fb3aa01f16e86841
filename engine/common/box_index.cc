#include "engine/common/box_index.h"

#include <algorithm>
#include <boost/geometry/algorithms/covered_by.hpp>
#include <boost/geometry/algorithms/equals.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <boost/geometry/strategies/index/cartesian.hpp>
#include <boost/geometry/strategies/relate/cartesian.hpp>
#include <utility>

namespace terrace::dem {
namespace {

using Point = boost::geometry::model::point<double, 2, boost::geometry::cs::cartesian>;
using Rectangle = boost::geometry::model::box<Point>;
using Value = std::pair<Rectangle, std::size_t>;

Rectangle RectangleOf(const Box& box) { return {{box.min_x, box.min_y}, {box.max_x, box.max_y}}; }

Value ValueOf(const BoxIndex::Entry& entry) { return {RectangleOf(entry.box), entry.value}; }

std::vector<Value> ValuesOf(const std::vector<BoxIndex::Entry>& entries) {
  std::vector<Value> values;
  values.reserve(entries.size());
  for (const BoxIndex::Entry& entry : entries) values.push_back(ValueOf(entry));
  return values;
}

}  // namespace

struct BoxIndex::Tree {
  explicit Tree(const std::vector<Value>& values) : tree(values) {}

  boost::geometry::index::rtree<Value, boost::geometry::index::quadratic<16>> tree;
};

BoxIndex::BoxIndex() = default;
BoxIndex::BoxIndex(const std::vector<Entry>& entries) : tree_(std::make_unique<Tree>(ValuesOf(entries))) {}
BoxIndex::BoxIndex(BoxIndex&&) noexcept = default;
BoxIndex& BoxIndex::operator=(BoxIndex&&) noexcept = default;
BoxIndex::~BoxIndex() = default;

void BoxIndex::Remove(const Entry& entry) { tree_->tree.remove(ValueOf(entry)); }

std::vector<std::size_t> BoxIndex::Find(const Box& box) const {
  std::vector<std::size_t> found;
  if (tree_ == nullptr) return found;
  for (auto it = tree_->tree.qbegin(boost::geometry::index::intersects(RectangleOf(box))); it != tree_->tree.qend();
       ++it) {
    found.push_back(it->second);
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool BoxIndex::Any(const Box& box) const {
  return tree_ != nullptr &&
         tree_->tree.qbegin(boost::geometry::index::intersects(RectangleOf(box))) != tree_->tree.qend();
}

}  // namespace terrace::dem
