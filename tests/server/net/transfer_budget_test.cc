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
  void Drain(std::chrono::steady_clock::time_point) override {}
  void Abort() override { ++aborts; }
  void Displace() override { ++displaced; }
  int aborts = 0, displaced = 0;
};

Body BodyOf(std::size_t bytes) { return std::make_shared<const std::string>(bytes, 'x'); }

constexpr std::size_t kMb = 1'000'000;

// 4 MB for replies of up to 500 kB, 2 MB for larger ones, 2 MB for uploads.
class TransferBudgetTest : public testing::Test {
 protected:
  using Hold = TransferBudget::Hold;
  using Kind = TransferBudget::Kind;

  TransferBudget::HoldRequest AskFor(Body body, std::uint64_t client = 1, Kind kind = Kind::kReply) {
    TransferBudget::HoldRequest ask = AskFor(body ? body->size() : 0, client, kind);
    ask.body = std::move(body);
    return ask;
  }
  TransferBudget::HoldRequest AskFor(std::size_t bytes, std::uint64_t client = 1, Kind kind = Kind::kUpload) {
    TransferBudget::HoldRequest ask;
    ask.kind = kind;
    ask.bytes = bytes;
    ask.client = client;
    ask.holder = connection_;
    return ask;
  }
  std::optional<Hold> Try(Body body, std::uint64_t client = 1, Kind kind = Kind::kReply) {
    return budget_.TryHold(AskFor(std::move(body), client, kind));
  }
  std::optional<Hold> TryUpload(std::size_t bytes, std::uint64_t client = 1) {
    return budget_.TryHold(AskFor(bytes, client));
  }
  // Records `name` and keeps the hold when there is memory. The deadline is in an hour, or has passed with `is_late`.
  void Wait(int name, TransferBudget::HoldRequest ask, bool is_late = false,
            asio::cancellation_slot slot = asio::cancellation_slot()) {
    const auto deadline = now_ + (is_late ? -1h : 1h);
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

  // A reply of another connection that is being sent.
  std::optional<Hold> Offer(std::size_t bytes, std::uint64_t client, std::shared_ptr<FakeTransfer>& connection) {
    connection_ = connection = std::make_shared<FakeTransfer>();
    auto hold = Try(BodyOf(bytes), client);
    if (hold) hold->BeginReply();
    return hold;
  }

  TransferBudget::Clock::time_point now_ = TransferBudget::Clock::now();
  TransferBudget budget_{8 * kMb, [this] { return now_; }};
  std::shared_ptr<FakeTransfer> connection_ = std::make_shared<FakeTransfer>();
  std::vector<int> granted_, refused_;
  std::vector<Hold> holds_;
  asio::io_context io_{1};
};

TEST_F(TransferBudgetTest, GivesRoomBack) {
  {
    const auto first = Try(BodyOf(kMb * 6 / 5));
    ASSERT_TRUE(first);
    EXPECT_EQ(budget_.stats().held_bytes, kMb * 6 / 5);
    EXPECT_FALSE(Try(BodyOf(kMb), 2));
    EXPECT_TRUE(Try(BodyOf(kMb * 7 / 10), 2));
    EXPECT_EQ(budget_.stats().held_bytes, kMb * 6 / 5);
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

TEST_F(TransferBudgetTest, RoomsTakeNothingFromOneAnother) {
  std::vector<Hold> uploads, small;
  while (auto upload = TryUpload(kMb / 10)) uploads.push_back(*std::move(upload));
  EXPECT_EQ(uploads.size(), 20u) << "a quarter";
  const auto large = Try(BodyOf(2 * kMb)), oversized = Try(BodyOf(10 * kMb));
  EXPECT_TRUE(large && oversized);
  for (std::uint64_t client = 1; auto hold = Try(BodyOf(kMb / 2), client); ++client) small.push_back(*std::move(hold));
  EXPECT_EQ(small.size(), 8u) << "half, whatever else is held";
  EXPECT_TRUE(TryUpload(3 * kMb)) << "a single one may be larger";
}

// Whatever the number and the size of one client's replies, another client gets its tile immediately.
TEST_F(TransferBudgetTest, NoClientKeepsSmallRepliesOfOthersOut) {
  std::vector<Hold> holds;
  for (const std::size_t bytes : {2 * kMb, 6 * kMb, kMb / 2, kMb / 10}) {
    while (auto hold = Try(BodyOf(bytes), 1)) holds.push_back(*std::move(hold));
    for (int i = 0; i < 4; ++i) Wait(i, AskFor(BodyOf(bytes), 1));
  }
  EXPECT_TRUE(Try(BodyOf(kMb / 2), 2));
}

TEST_F(TransferBudgetTest, LeavesSmallBodiesAlone) {
  std::vector<Hold> holds;
  for (int i = 0; i < 1000; ++i) holds.push_back(*Try(BodyOf(TransferBudget::kFreeBytes)));
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(Try(nullptr));
}

TEST_F(TransferBudgetTest, KeepsAReserveForVitalReplies) {
  std::vector<Hold> unread, holds;
  for (std::uint64_t client = 1; auto hold = Try(BodyOf(kMb / 2), client); ++client) unread.push_back(*std::move(hold));
  EXPECT_FALSE(Try(BodyOf(kMb / 10)));
  while (auto hold = Try(BodyOf(kMb / 10), 1, Kind::kVitalReply)) holds.push_back(*std::move(hold));
  EXPECT_EQ(holds.size(), TransferBudget::kReserve / (kMb / 10)) << "and not without end";
  holds.clear();
  EXPECT_EQ(budget_.stats().held_bytes, 4 * kMb);
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
  EXPECT_EQ(holds.size(), 26u) << "two thirds of 40";
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(takes(kOther));
  EXPECT_FALSE(takes(kGreedy));
  holds.clear();
  EXPECT_TRUE(takes(kGreedy)) << "what was given back counts no more";
}

TEST_F(TransferBudgetTest, ASharedBodyCountsAgainstThoseWhoReadIt) {
  const Body shared = BodyOf(kMb * 6 / 10);
  auto first = Try(shared, 1), second = Try(shared, 3);
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(Try(BodyOf(kMb), 1)) << "it has its share";
  first.reset();
  EXPECT_FALSE(Try(BodyOf(kMb), 3)) << "now it is the other one's";
  EXPECT_TRUE(Try(BodyOf(kMb), 1));
  second.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(Try(BodyOf(2 * kMb), 3)) << "one reply may take all";
}

TEST_F(TransferBudgetTest, LetsOneOversizedBodyPass) {
  auto large = Try(BodyOf(10 * kMb));
  ASSERT_TRUE(large);
  EXPECT_EQ(budget_.stats().held_bytes, 10 * kMb);
  EXPECT_FALSE(Try(BodyOf(10 * kMb), 2));
  EXPECT_TRUE(Try(BodyOf(2 * kMb))) << "beside it";
  large.reset();
  EXPECT_TRUE(Try(BodyOf(10 * kMb), 2));
}

TEST_F(TransferBudgetTest, NextIsTheClientThatHasUsedTheRoomLeastLately) {
  auto room = Try(BodyOf(2 * kMb), 1);
  for (int i = 0; i < 3; ++i) Wait(10 + i, AskFor(BodyOf(2 * kMb), 1));
  now_ += 3s;
  Wait(20, AskFor(BodyOf(2 * kMb), 2));
  Wait(30, AskFor(BodyOf(2 * kMb), 3));
  EXPECT_TRUE(granted_.empty());
  EXPECT_EQ(budget_.stats().waiting, 5u);
  room.reset();
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{20}) << "client 1 waits longest and holds nothing, but has had its turn";
  now_ += 1s;
  Wait(21, AskFor(BodyOf(2 * kMb), 2));
  const auto next = [&] {
    holds_.clear();
    Poll();
    now_ += 1s;
    return granted_.back();
  };
  EXPECT_EQ(next(), 30);
  EXPECT_EQ(next(), 21) << "one second of use against three";
  EXPECT_EQ(next(), 10);
  EXPECT_EQ(next(), 11);
  EXPECT_EQ(next(), 12);
  EXPECT_EQ(budget_.stats().waiting, 0u);
  EXPECT_EQ(budget_.stats().refused, 0u);
}

TEST_F(TransferBudgetTest, NobodyOvertakesWhoWaitsAndHasUsedNoMore) {
  const auto room = Try(BodyOf(kMb), 1);
  auto used = Try(BodyOf(kMb), 2);
  ASSERT_TRUE(room && used);
  now_ += 3s;
  used.reset();
  Wait(1, AskFor(BodyOf(2 * kMb), 2));
  EXPECT_TRUE(Try(BodyOf(kMb * 6 / 10), 3)) << "there is room, and the one who waits has had its turn";
  Wait(2, AskFor(BodyOf(2 * kMb), 4));
  EXPECT_FALSE(Try(BodyOf(kMb * 6 / 10), 3)) << "there is room, but this one has not";
}

TEST_F(TransferBudgetTest, UseIsForgotten) {
  auto room = Try(BodyOf(2 * kMb), 1);
  now_ += 3s;
  room.reset();
  now_ += 120s;
  room = Try(BodyOf(2 * kMb), 9);
  Wait(1, AskFor(BodyOf(2 * kMb), 1));
  Wait(2, AskFor(BodyOf(2 * kMb), 2));
  room.reset();
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{1}) << "the oldest of those alike";
}

// Otherwise a stream of new clients would block those that request twice.
TEST_F(TransferBudgetTest, LittleUseTakesNobodysPlace) {
  auto little = Try(BodyOf(kMb * 6 / 10), 1);
  now_ += 50ms;
  little.reset();
  auto room = Try(BodyOf(2 * kMb), 9);
  Wait(1, AskFor(BodyOf(kMb), 1));
  for (int i = 2; i < 6; ++i) Wait(i, AskFor(BodyOf(kMb), static_cast<std::uint64_t>(i)));
  room.reset();
  Poll();
  EXPECT_EQ(granted_, (std::vector<int>{1, 2}));
}

TEST_F(TransferBudgetTest, RefusesAtTheDeadline) {
  const auto room = Try(BodyOf(2 * kMb));
  Wait(1, AskFor(BodyOf(kMb), 2), /*is_late=*/true);
  EXPECT_EQ(refused_, std::vector<int>{1});
  EXPECT_EQ(budget_.stats().refused, 1u);
  EXPECT_EQ(budget_.stats().waiting, 0u);
}

TEST_F(TransferBudgetTest, WhoLeavesDoesNotBlockTheLine) {
  auto room = Try(BodyOf(kMb));
  asio::cancellation_signal leave;
  Wait(1, AskFor(BodyOf(2 * kMb), 2), false, leave.slot());
  Wait(2, AskFor(BodyOf(kMb), 3));
  EXPECT_TRUE(granted_.empty()) << "behind one that needs more";
  leave.emit(asio::cancellation_type::terminal);
  Poll();
  EXPECT_EQ(granted_, std::vector<int>{2});
}

TEST_F(TransferBudgetTest, CutsWhoIsLateAndHoldsMost) {
  std::shared_ptr<FakeTransfer> greedy, modest, recent;
  const auto large = Offer(kMb, 1, greedy), small = Offer(kMb * 6 / 10, 2, modest);
  now_ += 2s;
  const auto quick = Offer(kMb / 100 * 51, 1, recent);
  EXPECT_FALSE(quick) << "its share";
  ASSERT_TRUE(large && small);
  Wait(1, AskFor(BodyOf(2 * kMb), 1));
  EXPECT_EQ(greedy->aborts, 0) << "its own wait for one another";
  EXPECT_EQ(modest->aborts, 0) << "it holds less";
  Wait(2, AskFor(BodyOf(2 * kMb), 3));
  EXPECT_EQ(greedy->aborts, 1);
  EXPECT_EQ(modest->aborts, 0);
  Wait(3, AskFor(BodyOf(2 * kMb), 4));
  EXPECT_EQ(greedy->aborts, 1) << "told once";
  EXPECT_EQ(budget_.stats().cut, 1u);
}

// 30 MB at the required rate take half a minute. Nobody waits that long for a client that reads nothing.
TEST_F(TransferBudgetTest, TimeCountsByWhatIsTaken) {
  std::shared_ptr<FakeTransfer> slow, stopped, quick;
  auto hold = Offer(30 * kMb, 1, slow);
  ASSERT_TRUE(hold);
  now_ += 1900ms;
  hold->AddTaken(8192);
  Wait(1, AskFor(BodyOf(30 * kMb), 3));
  EXPECT_EQ(slow->aborts, 0);
  now_ += 200ms;
  Wait(2, AskFor(BodyOf(30 * kMb), 4));
  EXPECT_EQ(slow->aborts, 1);
  hold.reset();
  Poll();
  holds_.clear();
  Poll();
  holds_.clear();
  ASSERT_EQ(granted_, (std::vector<int>{1, 2}));

  hold = Offer(30 * kMb, 1, quick);
  for (int i = 0; i < 20; ++i) {
    now_ += 1s;
    hold->AddTaken(TransferBudget::kRate);
  }
  Wait(3, AskFor(BodyOf(30 * kMb), 3));
  EXPECT_EQ(quick->aborts, 0) << "it keeps up";
  hold.reset();
  Poll();
  holds_.clear();

  hold = Offer(30 * kMb, 1, stopped);
  hold->AddTaken(20 * kMb);
  now_ += 2s;
  Wait(4, AskFor(BodyOf(30 * kMb), 4));
  EXPECT_EQ(stopped->aborts, 1) << "what it took at once gives it no time for the rest";
}

TEST_F(TransferBudgetTest, AReplyThatIsBeingMadeIsNotLate) {
  const auto hold = Try(BodyOf(2 * kMb), 1);
  now_ += 60s;
  Wait(1, AskFor(BodyOf(2 * kMb), 2));
  EXPECT_EQ(connection_->aborts, 0) << "the client has nothing to take yet";
}

// A body that exceeds its budget counts as held as well.
TEST_F(TransferBudgetTest, CutsTheLateHolderOfAnOversizedBody) {
  std::shared_ptr<FakeTransfer> oversized, large;
  const auto slow = Offer(10 * kMb, 1, oversized), other = Offer(2 * kMb, 5, large);
  ASSERT_TRUE(slow && other);
  now_ += 3s;
  Wait(1, AskFor(BodyOf(2 * kMb), 2));
  EXPECT_EQ(oversized->aborts, 0) << "it holds more, but its end would make no room for this one";
  EXPECT_EQ(large->aborts, 1);
  Wait(2, AskFor(BodyOf(10 * kMb), 2));
  EXPECT_EQ(oversized->aborts, 1);
}

// Otherwise two of them would displace each other forever.
TEST_F(TransferBudgetTest, AnOversizedUploadIsDisplacedOnceItIsLate) {
  const auto upload = TryUpload(3 * kMb, 1);
  ASSERT_TRUE(upload);
  Wait(1, AskFor(3 * kMb, 2));
  EXPECT_EQ(connection_->displaced, 0);
  now_ += 6s;
  Wait(2, AskFor(3 * kMb, 3));
  EXPECT_EQ(connection_->displaced, 1);
}

TEST_F(TransferBudgetTest, AnUploadTakesFromWhoHoldsMost) {
  std::vector<std::shared_ptr<FakeTransfer>> uploaders;
  std::vector<Hold> holds;
  for (int i = 0; i < 20; ++i) {
    connection_ = std::make_shared<FakeTransfer>();
    uploaders.push_back(connection_);
    auto hold = TryUpload(kMb / 10, 1);
    ASSERT_TRUE(hold);
    hold->EndUpload();
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
  const auto unfinished = TryUpload(kMb, 1);
  connection_ = whole;
  auto waiting = TryUpload(kMb, 2);
  ASSERT_TRUE(unfinished && waiting);
  waiting->EndUpload();
  now_ += 60s;
  Wait(1, AskFor(kMb, 3));
  EXPECT_EQ(slow->displaced, 1) << "nobody holds more than the one who waits would, but this has had its time";
  EXPECT_EQ(whole->displaced, 0) << "it is the server's turn";
}

}  // namespace
}  // namespace terrace::server
