#include "server/net/transfer_budget.h"

#include <gtest/gtest.h>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <exception>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

struct FakeTransfer : Connection {
  Phase phase() const override { return Phase::kServes; }
  void Evict() override {}
  void Drain() override {}
  void Abort() override { ++aborts; }
  void Displace() override { ++displaced; }
  int aborts = 0, displaced = 0;
};

Body BodyOf(std::size_t bytes) { return std::make_shared<const std::string>(bytes, 'x'); }

constexpr std::size_t kMb = 1'000'000;

// 3 MB for replies, 1 MB for uploads.
class TransferBudgetTest : public testing::Test {
 protected:
  using Hold = TransferBudget::Hold;
  using Kind = TransferBudget::Kind;

  TransferBudget::Ask AskFor(Body body, std::uint64_t client = 1, Kind kind = Kind::kReply) {
    TransferBudget::Ask ask = AskFor(body ? body->size() : 0, client, kind);
    ask.body = std::move(body);
    return ask;
  }
  TransferBudget::Ask AskFor(std::size_t bytes, std::uint64_t client = 1, Kind kind = Kind::kUpload) {
    TransferBudget::Ask ask;
    ask.kind = kind;
    ask.bytes = bytes;
    ask.client = client;
    ask.holder = connection_;
    return ask;
  }
  std::optional<Hold> Try(Body body, std::uint64_t client = 1, Kind kind = Kind::kReply) {
    return budget_.TryHold(AskFor(std::move(body), client, kind), now_);
  }
  std::optional<Hold> TryUpload(std::size_t bytes, std::uint64_t client = 1) {
    return budget_.TryHold(AskFor(bytes, client), now_);
  }
  // `name` is noted, and the hold kept, when there is room. Deadlines are an hour away unless they have passed.
  void Wait(int name, TransferBudget::Ask ask, bool is_late = false,
            asio::cancellation_slot slot = asio::cancellation_slot()) {
    const auto deadline = TransferBudget::Clock::now() + (is_late ? -1h : 1h);
    auto keep = [this, name](std::exception_ptr, std::optional<Hold> hold) {
      (hold ? granted_ : refused_).push_back(name);
      if (hold) holds_.push_back(*std::move(hold));
    };
    asio::co_spawn(io_, budget_.HoldWhenRoom(std::move(ask), deadline), asio::bind_cancellation_slot(slot, keep));
    Poll();
  }
  void Poll() {
    io_.restart();
    io_.poll();
  }

  TransferBudget budget_{4 * kMb};
  std::shared_ptr<FakeTransfer> connection_ = std::make_shared<FakeTransfer>();
  TransferBudget::Clock::time_point now_ = TransferBudget::Clock::now();
  std::vector<int> granted_, refused_;
  std::vector<Hold> holds_;
  asio::io_context io_{1};
};

TEST_F(TransferBudgetTest, GivesRoomBack) {
  {
    const auto first = Try(BodyOf(2 * kMb));
    ASSERT_TRUE(first);
    EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
    EXPECT_FALSE(Try(BodyOf(2 * kMb), 2));
    EXPECT_TRUE(Try(BodyOf(kMb), 2));
    EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
  }
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
}

TEST_F(TransferBudgetTest, CountsASharedBodyOnce) {
  const Body body = BodyOf(2 * kMb);
  auto first = Try(body, 1), second = Try(body, 2);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
  first.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb) << "the second still has it";
  second.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
}

TEST_F(TransferBudgetTest, UploadsAndRepliesDoNotKeepOneAnotherOut) {
  std::vector<Hold> uploads;
  while (auto upload = TryUpload(kMb / 10)) uploads.push_back(*std::move(upload));
  EXPECT_EQ(uploads.size(), 10u) << "a quarter of the room";
  const auto reply = Try(BodyOf(3 * kMb));
  EXPECT_TRUE(reply);
  uploads.clear();
  EXPECT_TRUE(TryUpload(2 * kMb)) << "a single one may be larger";
}

TEST_F(TransferBudgetTest, LeavesSmallBodiesAlone) {
  std::vector<Hold> holds;
  for (int i = 0; i < 1000; ++i) holds.push_back(*Try(BodyOf(TransferBudget::kFreeBytes)));
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(Try(nullptr));
}

TEST_F(TransferBudgetTest, KeepsAReserveForVitalReplies) {
  const auto unread = Try(BodyOf(3 * kMb));
  ASSERT_TRUE(unread);
  EXPECT_FALSE(Try(BodyOf(kMb / 10)));
  std::vector<Hold> holds;
  while (auto hold = Try(BodyOf(kMb / 10), 1, Kind::kVitalReply)) holds.push_back(*std::move(hold));
  EXPECT_EQ(holds.size(), TransferBudget::kReserve / (kMb / 10)) << "and not without end";
  holds.clear();
  EXPECT_EQ(budget_.stats().held_bytes, 3 * kMb);
}

TEST_F(TransferBudgetTest, OneClientLeavesRoomForOthers) {
  constexpr std::uint64_t kGreedy = 1, kOther = 3;
  std::vector<Hold> holds;
  const auto takes = [&](std::uint64_t client) {
    auto hold = Try(BodyOf(kMb / 10), client);
    if (hold) holds.push_back(*std::move(hold));
    return hold.has_value();
  };
  while (takes(kGreedy)) continue;
  EXPECT_EQ(holds.size(), 20u) << "two thirds of 30";
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(takes(kOther));
  EXPECT_FALSE(takes(kGreedy));
  holds.clear();
  EXPECT_TRUE(takes(kGreedy)) << "what was given back counts no more";
}

TEST_F(TransferBudgetTest, ASharedBodyCountsAgainstThoseWhoReadIt) {
  const Body shared = BodyOf(kMb);
  auto first = Try(shared, 1), second = Try(shared, 3);
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(Try(BodyOf(2 * kMb), 1)) << "it has its share";
  first.reset();
  EXPECT_FALSE(Try(BodyOf(2 * kMb), 3)) << "now it is the other one's";
  EXPECT_TRUE(Try(BodyOf(2 * kMb), 1));
  second.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(Try(BodyOf(3 * kMb), 3)) << "one reply may take all";
}

TEST_F(TransferBudgetTest, LetsOneOversizedBodyPass) {
  auto large = Try(BodyOf(10 * kMb));
  ASSERT_TRUE(large);
  EXPECT_FALSE(Try(BodyOf(10 * kMb)));
  EXPECT_TRUE(Try(BodyOf(3 * kMb))) << "beside it";
  large.reset();
  EXPECT_TRUE(Try(BodyOf(10 * kMb)));
}

TEST_F(TransferBudgetTest, WaitsForRoomAndTheClientThatHoldsLeastIsNext) {
  constexpr std::size_t kSize = kMb * 3 / 4;
  auto room = Try(BodyOf(2 * kMb), 1), other = Try(BodyOf(kMb / 2), 4);
  const auto kept = Try(BodyOf(kMb / 4), 2);
  ASSERT_TRUE(room && other && kept);
  for (int i = 0; i < 3; ++i) Wait(10 + i, AskFor(BodyOf(kSize), 1));
  Wait(20, AskFor(BodyOf(kSize), 2));
  Wait(30, AskFor(BodyOf(kSize), 3));
  EXPECT_TRUE(granted_.empty());
  EXPECT_EQ(budget_.stats().waiting, 5u);
  EXPECT_FALSE(Try(BodyOf(kMb / 8), 2)) << "nobody overtakes who waits and holds less";
  other.reset();
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{30});
  room.reset();
  Poll();
  EXPECT_EQ(granted_, (std::vector<int>{30, 10, 20}));
  holds_.clear();
  Poll();
  EXPECT_EQ(granted_, (std::vector<int>{30, 10, 20, 11, 12}));
  EXPECT_EQ(budget_.stats().waiting, 0u);
  EXPECT_EQ(budget_.stats().refused, 0u);
}

TEST_F(TransferBudgetTest, RefusesAtTheDeadline) {
  const auto room = Try(BodyOf(3 * kMb));
  Wait(1, AskFor(BodyOf(kMb), 2), /*is_late=*/true);
  EXPECT_EQ(refused_, std::vector<int>{1});
  EXPECT_EQ(budget_.stats().refused, 1u);
  EXPECT_EQ(budget_.stats().waiting, 0u);
}

TEST_F(TransferBudgetTest, WhoLeavesDoesNotBlockTheLine) {
  auto room = Try(BodyOf(2 * kMb));
  asio::cancellation_signal leave;
  Wait(1, AskFor(BodyOf(3 * kMb), 2), false, leave.slot());
  Wait(2, AskFor(BodyOf(kMb), 3));
  EXPECT_TRUE(granted_.empty()) << "behind one that needs more";
  leave.emit(asio::cancellation_type::terminal);
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{2});
}

TEST_F(TransferBudgetTest, CutsWhoHasHadTheirTimeAndHoldsMost) {
  const auto greedy = connection_, modest = std::make_shared<FakeTransfer>(), recent = std::make_shared<FakeTransfer>();
  now_ -= 60s;
  const auto large = Try(BodyOf(kMb), 1);
  connection_ = modest;
  const auto small = Try(BodyOf(kMb / 2), 2);
  connection_ = recent;
  now_ += 60s;
  const auto quick = Try(BodyOf(kMb / 4), 1);
  ASSERT_TRUE(large && small && quick);
  Wait(1, AskFor(BodyOf(2 * kMb), 1));
  EXPECT_EQ(greedy->aborts, 0) << "its own wait for one another";
  Wait(2, AskFor(BodyOf(2 * kMb), 3));
  EXPECT_EQ(greedy->aborts, 1);
  EXPECT_EQ(modest->aborts, 0);
  EXPECT_EQ(recent->aborts, 0) << "it has not had its time";
  Wait(3, AskFor(BodyOf(2 * kMb), 4));
  EXPECT_EQ(greedy->aborts, 1) << "told once";
  EXPECT_EQ(budget_.stats().cut, 1u);
}

TEST_F(TransferBudgetTest, AnUploadTakesFromWhoHoldsMost) {
  std::vector<std::shared_ptr<FakeTransfer>> uploaders;
  std::vector<Hold> holds;
  for (int i = 0; i < 10; ++i) {
    connection_ = std::make_shared<FakeTransfer>();
    uploaders.push_back(connection_);
    auto hold = TryUpload(kMb / 10, 1);
    ASSERT_TRUE(hold);
    hold->Settle();
    holds.push_back(*std::move(hold));
  }
  Wait(1, AskFor(kMb / 10, 1));
  for (const auto& uploader : uploaders) EXPECT_EQ(uploader->displaced, 0) << "its own wait for one another";
  Wait(2, AskFor(kMb / 10, 2));
  EXPECT_EQ(uploaders.back()->displaced, 1) << "the newest";
  for (std::size_t i = 0; i + 1 < uploaders.size(); ++i) EXPECT_EQ(uploaders[i]->displaced, 0);
  holds.pop_back();
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{2});
}

TEST_F(TransferBudgetTest, UploadsThatDoNotArriveMakeRoomForThoseOfOthers) {
  const auto slow = connection_, whole = std::make_shared<FakeTransfer>();
  now_ -= 60s;
  const auto unfinished = TryUpload(kMb / 2, 1);
  connection_ = whole;
  auto waiting = TryUpload(kMb / 2, 2);
  ASSERT_TRUE(unfinished && waiting);
  waiting->Settle();
  Wait(1, AskFor(kMb / 2, 3));
  EXPECT_EQ(slow->displaced, 1) << "nobody holds more than the one who waits would, but this has had its time";
  EXPECT_EQ(whole->displaced, 0) << "it is the server's turn";
}

}  // namespace
}  // namespace terrace::server
