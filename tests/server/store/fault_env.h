// A file system that fails on request, in front of the real one.
#pragma once

#include <rocksdb/env.h>

#include <atomic>
#include <cstdint>
#include <memory>

namespace terrace::server {

// Which calls fail. Thread-safe.
class FaultPlan {
 public:
  enum class Kind { kRead = 1, kWrite = 2, kAny = 3 };

  // The nth call of this kind from now on fails, counted from 1; with `for_good` all later ones too.
  void FailNth(std::uint64_t n, Kind kind, bool for_good) {
    kind_ = kind;
    for_good_ = for_good;
    calls_ = 0;
    fail_at_ = n;
  }
  void Heal() { fail_at_ = 0; }
  std::uint64_t failures() const { return failures_; }

  bool Fails(Kind kind) {
    const std::uint64_t at = fail_at_;
    if (at == 0 || (static_cast<int>(kind) & static_cast<int>(kind_.load())) == 0) return false;
    const std::uint64_t call = ++calls_;
    const bool fails = call == at || (for_good_ && call > at);
    failures_ += fails ? 1 : 0;
    return fails;
  }

 private:
  std::atomic<Kind> kind_{Kind::kAny};
  std::atomic<bool> for_good_{false};
  std::atomic<std::uint64_t> calls_{0}, fail_at_{0}, failures_{0};
};

// `plan` must outlive the result.
std::unique_ptr<rocksdb::Env> MakeFaultEnv(FaultPlan& plan);

}  // namespace terrace::server
