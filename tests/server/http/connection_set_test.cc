#include "server/http/connection_set.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

namespace terrace::server {
namespace {

using Phase = Connection::Phase;

class FakeConnection : public Connection {
 public:
  explicit FakeConnection(Phase phase) : phase_(phase) {}
  Phase phase() const override { return phase_; }
  void Evict() override { evicted = true; }
  void Drain() override {}
  void Abort() override {}

  bool evicted = false;

 private:
  const Phase phase_;
};

class Eviction : public testing::Test {
 protected:
  FakeConnection& Add(Phase phase, const std::string& client) {
    connections_.push_back(std::make_shared<FakeConnection>(phase));
    set_.Add(connections_.back(), client);
    return *connections_.back();
  }
  void Remove(FakeConnection& connection) { set_.Remove(&connection); }

  ConnectionSet set_{100};
  std::vector<std::shared_ptr<FakeConnection>> connections_;
};

TEST_F(Eviction, BeginsWithIdleConnections) {
  const FakeConnection& serving = Add(Phase::kServes, "a");
  const FakeConnection& head = Add(Phase::kReadsHead, "a");
  const FakeConnection& idle = Add(Phase::kIdle, "b");
  EXPECT_TRUE(set_.EvictOne());
  EXPECT_TRUE(idle.evicted);
  EXPECT_FALSE(head.evicted || serving.evicted);
}

TEST_F(Eviction, TakesTheOldestOfTheClientThatHasMost) {
  const FakeConnection& polite = Add(Phase::kReadsHead, "polite");
  FakeConnection& first = Add(Phase::kReadsHead, "flood");
  const FakeConnection& second = Add(Phase::kReadsHead, "flood");
  EXPECT_TRUE(set_.EvictOne());
  EXPECT_TRUE(first.evicted);
  EXPECT_FALSE(polite.evicted || second.evicted);
  Remove(first);
  EXPECT_TRUE(set_.EvictOne());
  EXPECT_TRUE(polite.evicted) << "both have one: the older goes";
}

TEST_F(Eviction, LeavesConnectionsThatServe) {
  const FakeConnection& serving = Add(Phase::kServes, "a");
  EXPECT_FALSE(set_.EvictOne());
  EXPECT_FALSE(serving.evicted);
  EXPECT_FALSE(ConnectionSet(1).EvictOne()) << "nobody is there";
}

}  // namespace
}  // namespace terrace::server
