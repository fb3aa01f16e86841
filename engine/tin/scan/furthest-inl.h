// The furthest sample that a scan visits, in vectors of doubles, floats or integers. Compiled once for each instruction
// set; part of triangle_scan.cc.
#if defined(TERRACE_ENGINE_TIN_FURTHEST_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TERRACE_ENGINE_TIN_FURTHEST_INL_H_
#undef TERRACE_ENGINE_TIN_FURTHEST_INL_H_
#else
#define TERRACE_ENGINE_TIN_FURTHEST_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstdint>
#include <limits>
#include <type_traits>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Everything is evaluated in double, in single precision or in integers: the fastest of those that give the exact
// result. Single precision is exact for most triangles: all heights are multiples of a quantum (HeightField::quantum),
// so are all terms of the formula, and every multiple up to 2^24 quanta is a float. If terms may be larger, double or
// integers are used.
using DoublesTag = hn::CappedTag<double, 16>;
using FloatsTag = hn::CappedTag<float, 16>;
constexpr DoublesTag kDoubles;
constexpr FloatsTag kFloats;
using Floats = hn::Vec<FloatsTag>;

// Numbers of samples (SampleNumber): in doubles beside doubles, in integers beside floats, which cannot hold them.
template <typename Tag>
using NumberTag = std::conditional_t<std::is_same_v<hn::TFromD<Tag>, float>, hn::RebindToSigned<Tag>, Tag>;
using IntsTag = NumberTag<FloatsTag>;
using Ints = hn::Vec<IntsTag>;
constexpr IntsTag kInts;

template <typename Tag>
HWY_INLINE int LanesOf() {
  return static_cast<int>(hn::Lanes(Tag()));
}
template <typename Tag, typename Value>
HWY_INLINE hn::Vec<Tag> All(Tag tag, Value value) {
  return hn::Set(tag, static_cast<hn::TFromD<Tag>>(value));
}

// The numbers of the lanes, loaded from memory: hn::Iota computes them in a loop each time.
template <typename T>
struct LaneNumbers {
  HWY_ALIGN static constexpr T kValues[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
};
template <typename Tag, typename Value>
HWY_INLINE hn::Vec<Tag> From(Tag tag, Value first) {
  static_assert(hn::MaxLanes(Tag()) <= 16);
  return hn::Add(All(tag, first), hn::Load(tag, LaneNumbers<hn::TFromD<Tag>>::kValues));
}

template <typename Tag>
HWY_INLINE std::uint32_t BitsOf(Tag tag, hn::Mask<Tag> mask) {
  std::uint64_t bits = 0;  // at least eight bytes
  hn::StoreMaskBits(tag, mask, reinterpret_cast<std::uint8_t*>(&bits));
  return static_cast<std::uint32_t>(bits);
}

// The maximum and the minimum; b if one of them is NaN.
HWY_INLINE Floats MaxOrSecond(Floats a, Floats b) {
#if HWY_ARCH_X86
  return hn::Max(a, b);  // the instruction does just that
#else
  return hn::IfThenElse(hn::Gt(a, b), a, b);
#endif
}
HWY_INLINE Floats MinOrSecond(Floats a, Floats b) {
#if HWY_ARCH_X86
  return hn::Min(a, b);
#else
  return hn::IfThenElse(hn::Lt(a, b), a, b);
#endif
}

// The furthest sample so far in each lane. Each lane visits its samples in row-major order, so ">" keeps the first of
// equals. Comparisons with NaN are false.
template <typename TagOfNumerators>
class Furthest {
 public:
  using Tag = TagOfNumerators;
  using Numbers = hn::Vec<NumberTag<Tag>>;

  HWY_INLINE Furthest() : numerator_(All(kTag, -1)), number_(hn::Zero(kNumbers)) {}

  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Numbers number, hn::Mask<Tag> inside) {
    Keep(hn::And(inside, hn::Gt(numerator, numerator_)), numerator, number);
  }
  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Numbers number) {
    const auto is_further = hn::Gt(numerator, numerator_);
    if constexpr (std::is_same_v<Tag, FloatsTag>) {
      numerator_ = MaxOrSecond(numerator, numerator_);  // so that the next sample does not wait for the mask
    } else if constexpr (std::is_same_v<Tag, IntsTag>) {
      numerator_ = hn::Max(numerator, numerator_);
    } else {
      numerator_ = hn::IfThenElse(is_further, numerator, numerator_);
    }
    number_ = hn::IfThenElse(hn::RebindMask(kNumbers, is_further), number, number_);
  }

  // Adds `columns` to the columns of all visited samples.
  HWY_INLINE void MoveEast(int columns) { number_ = hn::Add(number_, All(kNumbers, columns)); }
  // Merges samples that were visited separately.
  HWY_INLINE void Merge(const Furthest& other) {
    const auto tied =
        hn::And(hn::Eq(other.numerator_, numerator_), hn::RebindMask(kTag, hn::Lt(other.number_, number_)));
    Keep(hn::Or(hn::Gt(other.numerator_, numerator_), tied), other.numerator_, other.number_);
  }

  HWY_INLINE hn::Vec<Tag> numerators() const { return numerator_; }
  HWY_INLINE Numbers numbers() const { return number_; }
  HWY_INLINE hn::TFromD<Tag> numerator() const { return hn::GetLane(hn::MaxOfLanes(kTag, numerator_)); }

  // Precondition: numerator() is not negative. Usually a single lane has the largest numerator; finding the smallest
  // number of several lanes takes a chain of eight operations.
  HWY_INLINE std::uint32_t sample() const {
    const auto foremost = hn::RebindMask(kNumbers, hn::Eq(numerator_, hn::MaxOfLanes(kTag, numerator_)));
    const std::uint32_t lanes = BitsOf(kNumbers, foremost);
    auto first = hn::TFromD<NumberTag<Tag>>();
    if (std::has_single_bit(lanes)) [[likely]] {
      HWY_ALIGN decltype(first) numbers[hn::MaxLanes(kNumbers)];
      hn::Store(number_, kNumbers, numbers);
      first = numbers[std::countr_zero(lanes)];
    } else {
      const Numbers none = All(kNumbers, std::numeric_limits<std::int32_t>::max());
      first = hn::GetLane(hn::MinOfLanes(kNumbers, hn::IfThenElse(foremost, number_, none)));
    }
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(first));
  }

 private:
  static constexpr Tag kTag{};
  static constexpr NumberTag<Tag> kNumbers{};

  HWY_INLINE void Keep(hn::Mask<Tag> which, hn::Vec<Tag> numerator, Numbers number) {
    numerator_ = hn::IfThenElse(which, numerator, numerator_);
    number_ = hn::IfThenElse(hn::RebindMask(kNumbers, which), number, number_);
  }

  hn::Vec<Tag> numerator_;  // D times the distance
  Numbers number_;
};

// Furthest for inexact single precision: also tracks the second largest numerator.
class FurthestTwo {
 public:
  using Tag = FloatsTag;
  using Numbers = Furthest<FloatsTag>::Numbers;

  HWY_INLINE FurthestTwo() : runner_up_(All(kFloats, -1)) {}

  HWY_INLINE void Visit(Floats numerator, Numbers number, hn::Mask<FloatsTag> inside) {
    Visit(hn::IfThenElse(inside, numerator, All(kFloats, -1)), number);
  }
  HWY_INLINE void Visit(Floats numerator, Numbers number) {
    runner_up_ = MaxOrSecond(MinOrSecond(furthest_.numerators(), numerator), runner_up_);
    furthest_.Visit(numerator, number);
  }
  HWY_INLINE void MoveEast(int columns) { furthest_.MoveEast(columns); }
  HWY_INLINE void Merge(const FurthestTwo& other) {
    runner_up_ =
        hn::Max(hn::Max(runner_up_, other.runner_up_), hn::Min(furthest_.numerators(), other.furthest_.numerators()));
    furthest_.Merge(other.furthest_);
  }

  HWY_INLINE float numerator() const { return furthest_.numerator(); }
  HWY_INLINE float runner_up() const { return hn::GetLane(hn::MaxOfLanes(kFloats, runner_up_)); }
  HWY_INLINE const Furthest<FloatsTag>& furthest() const { return furthest_; }

 private:
  Furthest<FloatsTag> furthest_;
  Floats runner_up_;
};

template <typename Found>
inline constexpr bool kIsInteger = std::is_same_v<Found, Furthest<IntsTag>>;
// Whether sums are exact; then planes may be stepped.
template <typename Found>
inline constexpr bool kIsExact = std::is_same_v<Found, Furthest<FloatsTag>> || kIsInteger<Found>;

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
