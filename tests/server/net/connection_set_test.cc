#include "server/net/connection_set.h"

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
  void Drain(std::chrono::steady_clock::time_point) override {}
  void Abort() override { aborted = true; }

  bool evicted = false, aborted = false;

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
  const FakeConnection& head = Add(Phase::kReceives, "a");
  const FakeConnection& idle = Add(Phase::kIdle, "a");
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(idle.evicted);
  EXPECT_FALSE(head.evicted || serving.evicted);
}

TEST_F(Eviction, TakesTheOldestOfTheClientThatHasMost) {
  const FakeConnection& polite = Add(Phase::kReceives, "polite");
  FakeConnection& first = Add(Phase::kReceives, "flood");
  const FakeConnection& second = Add(Phase::kReceives, "flood");
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(first.evicted);
  EXPECT_FALSE(polite.evicted || second.evicted);
  Remove(first);
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(polite.evicted) << "both have one: the older goes";
}

TEST_F(Eviction, TakesTheNewestServingConnectionOfAClientThatHasMoreThanTheNewcomer) {
  const FakeConnection& polite = Add(Phase::kServes, "polite");
  const FakeConnection& proxies = Add(Phase::kServes, "");
  Add(Phase::kServes, "");
  const FakeConnection& first = Add(Phase::kServes, "flood");
  const FakeConnection& second = Add(Phase::kServes, "flood");
  EXPECT_FALSE(set_.EvictOne("flood"));
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(second.aborted);
  EXPECT_FALSE(first.aborted || polite.aborted || proxies.aborted);
  EXPECT_FALSE(set_.EvictOne("new")) << "the flood has one left, as the newcomer will";
}

// A client whose connections are all being served does not displace those of others, whatever their state.
TEST_F(Eviction, TakesFromTheClientThatHasMostWhateverItsConnectionsAreAt) {
  const FakeConnection& idle = Add(Phase::kIdle, "polite");
  const FakeConnection& secured = Add(Phase::kReceives, "slow line");
  Add(Phase::kServes, "flood");
  Add(Phase::kServes, "flood");
  const FakeConnection& newest = Add(Phase::kServes, "flood");
  EXPECT_FALSE(set_.EvictOne("flood")) << "it has most, and waits for its own";
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(newest.aborted);
  EXPECT_FALSE(idle.evicted || secured.evicted);
}

TEST_F(Eviction, AClientThatHasMostTakesItsOwn) {
  const FakeConnection& idle = Add(Phase::kIdle, "polite");
  Add(Phase::kServes, "flood");
  const FakeConnection& own = Add(Phase::kReceives, "flood");
  EXPECT_TRUE(set_.EvictOne("flood"));
  EXPECT_TRUE(own.evicted);
  EXPECT_FALSE(idle.evicted);
}

// A proxy sends requests of many clients, which must not count as one.
TEST_F(Eviction, ConnectionsOfProxiesAreNoClient) {
  const FakeConnection& first = Add(Phase::kIdle, "");
  const FakeConnection& second = Add(Phase::kReceives, "");
  FakeConnection& direct = Add(Phase::kReceives, "direct");
  Add(Phase::kServes, "direct");
  EXPECT_TRUE(set_.EvictOne(""));
  EXPECT_TRUE(direct.evicted);
  Remove(direct);
  EXPECT_TRUE(set_.EvictOne("new"));
  EXPECT_TRUE(first.evicted) << "the idle one of those alike";
  EXPECT_FALSE(second.evicted);
}

TEST_F(Eviction, LeavesConnectionsThatServe) {
  const FakeConnection& serving = Add(Phase::kServes, "a");
  EXPECT_FALSE(set_.EvictOne("new"));
  EXPECT_FALSE(serving.evicted);
  EXPECT_FALSE(ConnectionSet(1).EvictOne("new")) << "nobody is there";
}

}  // namespace
}  // namespace terrace::server
