// The properties of edits: the members of `terrain` of a feature.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/nearest_name.h"
#include "engine/core/result.h"
#include "engine/edits/edit.h"

namespace terrace::dem {

inline constexpr std::array<std::string_view, 11> kEditKeys = {
    "op", "blend_m", "height", "heights", "metres", "source", "width_m", "error_m", "factor", "min_level", "vertical"};

// Whether an operation has the property `key`, one of kEditKeys.
constexpr bool HasProperty(EditOp op, std::string_view key) {
  const bool is_profile = op == EditOp::kCarve || op == EditOp::kRaise;
  if (key == "op") return true;
  if (key == "blend_m") return op != EditOp::kBreakline && op != EditOp::kHole;
  if (key == "height") return op == EditOp::kFlatten || is_profile;
  if (key == "heights") return op == EditOp::kSlope;
  if (key == "metres") return op == EditOp::kOffset;
  if (key == "source") return op == EditOp::kReplace;
  if (key == "width_m") return is_profile || op == EditOp::kPrecision;
  if (key == "vertical") return op == EditOp::kFlatten || op == EditOp::kSlope || op == EditOp::kReplace || is_profile;
  return op == EditOp::kPrecision;  // error_m, factor, min_level
}

// The value of a member "vertical"; or what is wrong with it.
tl::expected<EditDatum, std::string> ParseDatum(const nlohmann::json& value);
// The same of a `replace`: SourceOptions::vertical, but not the path of a grid.
tl::expected<std::string, std::string> ParseSourceVertical(const nlohmann::json& value);

// `; did you mean "..."?` with the names that may be meant; empty if there are none.
template <typename Names>
std::string NearestOf(std::string_view word, const Names& names) {
  std::vector<KnownName> known;
  for (const std::string_view name : names) known.push_back({name});
  return DidYouMean(Quoted(NearestNames(word, known)));
}

}  // namespace terrace::dem
