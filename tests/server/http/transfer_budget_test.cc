#include "server/http/transfer_budget.h"

#include <gtest/gtest.h>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

struct FakeConnection : Connection {
  void CloseIfIdle() override {}
  void Drain() override {}
  void Abort() override { ++aborts; }
  int aborts = 0;
};

Body BodyOf(std::size_t bytes) { return std::make_shared<const std::string>(bytes, 'x'); }

constexpr std::size_t kMb = 1'000'000;

class TransferBudgetTest : public testing::Test {
 protected:
  TransferBudget budget_{3 * kMb};
  std::shared_ptr<FakeConnection> connection_ = std::make_shared<FakeConnection>();
  TransferBudget::Clock::time_point now_{};
};

TEST_F(TransferBudgetTest, GivesRoomBack) {
  {
    const auto first = budget_.TryHold(BodyOf(2 * kMb), connection_, now_);
    ASSERT_TRUE(first);
    EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
    EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_));
    EXPECT_TRUE(budget_.TryHold(BodyOf(kMb), connection_, now_));
    EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
  }
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_EQ(budget_.stats().refused, 1u);
}

TEST_F(TransferBudgetTest, CountsASharedBodyOnce) {
  const Body body = BodyOf(2 * kMb);
  auto first = budget_.TryHold(body, connection_, now_);
  auto second = budget_.TryHold(body, connection_, now_);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb);
  first.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb) << "the second still has it";
  second.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
}

TEST_F(TransferBudgetTest, RequestBodiesDoNotKeepRepliesOut) {
  std::vector<TransferBudget::Hold> uploads;
  while (auto upload = budget_.TryHold(kMb / 10, connection_, now_)) uploads.push_back(*std::move(upload));
  EXPECT_EQ(uploads.size(), 7u) << "a quarter of the room";
  EXPECT_TRUE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_));
  uploads.clear();
  EXPECT_TRUE(budget_.TryHold(2 * kMb, connection_, now_)) << "a single one may be larger";
}

TEST_F(TransferBudgetTest, UploadsCutOffUploadsAlone) {
  const auto uploader = std::make_shared<FakeConnection>();
  auto unread = budget_.TryHold(BodyOf(2 * kMb), connection_, now_);
  auto upload = budget_.TryHold(kMb / 2, uploader, now_);
  ASSERT_TRUE(unread && upload);
  EXPECT_FALSE(budget_.TryHold(kMb / 2, uploader, now_ + 60s));
  EXPECT_EQ(connection_->aborts, 0);
  EXPECT_EQ(uploader->aborts, 1);
}

TEST_F(TransferBudgetTest, WhoWaitsForAnAnswerIsNotCutOff) {
  auto upload = budget_.TryHold(kMb / 2, connection_, now_);
  auto unread = budget_.TryHold(BodyOf(2 * kMb), connection_, now_);
  ASSERT_TRUE(upload && unread);
  upload->Settle();
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_ + 60s));
  EXPECT_EQ(connection_->aborts, 1) << "for the reply alone";
  EXPECT_EQ(budget_.stats().held_bytes, 2 * kMb + kMb / 2) << "it counts all the same";
}

TEST_F(TransferBudgetTest, LeavesSmallBodiesAlone) {
  std::vector<TransferBudget::Hold> holds;
  for (int i = 0; i < 1000; ++i)
    holds.push_back(*budget_.TryHold(BodyOf(TransferBudget::kFreeBytes), connection_, now_));
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(budget_.TryHold(nullptr, connection_, now_));
}

TEST_F(TransferBudgetTest, KeepsAReserveForVitalReplies) {
  const auto vital = TransferBudget::Kind::kVitalReply;
  const auto unread = budget_.TryHold(BodyOf(3 * kMb), connection_, now_);
  ASSERT_TRUE(unread);
  EXPECT_FALSE(budget_.TryHold(BodyOf(kMb / 10), connection_, now_));
  std::vector<TransferBudget::Hold> holds;
  while (auto hold = budget_.TryHold(BodyOf(kMb / 10), connection_, now_, vital)) holds.push_back(*std::move(hold));
  EXPECT_EQ(holds.size(), TransferBudget::kReserve / (kMb / 10)) << "and not without end";
  EXPECT_FALSE(budget_.TryHold(BodyOf(kMb / 10), connection_, now_ + 60s, vital));
  EXPECT_GT(connection_->aborts, 0) << "whoever does not read makes room";
  holds.clear();
  EXPECT_EQ(budget_.stats().held_bytes, 3 * kMb);
}

TEST_F(TransferBudgetTest, OneClientLeavesRoomForOthers) {
  constexpr std::uint64_t kGreedy = 1, kOther = 3;
  std::vector<TransferBudget::Hold> holds;
  const auto takes = [&](std::uint64_t client) {
    auto hold = budget_.TryHold(BodyOf(kMb / 10), connection_, now_, TransferBudget::Kind::kReply, client);
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
  const auto reply = TransferBudget::Kind::kReply;
  const Body shared = BodyOf(kMb);
  auto first = budget_.TryHold(shared, connection_, now_, reply, 1);
  auto second = budget_.TryHold(shared, connection_, now_, reply, 3);
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_, reply, 1)) << "it has its share";
  first.reset();
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_, reply, 3)) << "now it is the other one's";
  EXPECT_TRUE(budget_.TryHold(BodyOf(2 * kMb), connection_, now_, reply, 1));
  second.reset();
  EXPECT_EQ(budget_.stats().held_bytes, 0u);
  EXPECT_TRUE(budget_.TryHold(BodyOf(3 * kMb), connection_, now_, reply, 3)) << "one reply may take all";
}

TEST_F(TransferBudgetTest, UploadsDoNotCountAgainstTheirOwnReplies) {
  auto upload = budget_.TryHold(2 * kMb, connection_, now_);
  ASSERT_TRUE(upload);
  EXPECT_TRUE(budget_.TryHold(BodyOf(kMb), connection_, now_, TransferBudget::Kind::kReply, 1));
}

TEST_F(TransferBudgetTest, LetsOneOversizedBodyPass) {
  auto large = budget_.TryHold(BodyOf(10 * kMb), connection_, now_);
  ASSERT_TRUE(large);
  EXPECT_FALSE(budget_.TryHold(BodyOf(10 * kMb), connection_, now_));
  EXPECT_TRUE(budget_.TryHold(BodyOf(3 * kMb), connection_, now_)) << "beside it";
  large.reset();
  EXPECT_TRUE(budget_.TryHold(BodyOf(10 * kMb), connection_, now_));
}

TEST_F(TransferBudgetTest, CutsWhoHasHadTheirTimeWhereOthersNeedTheRoom) {
  const auto quick = std::make_shared<FakeConnection>();
  const auto slow = budget_.TryHold(BodyOf(2 * kMb), connection_, now_);
  now_ += 3s;
  const auto recent = budget_.TryHold(std::size_t{kMb}, quick, now_);
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), quick, now_));
  EXPECT_EQ(connection_->aborts, 0) << "two seconds, and one for each MiB";
  now_ += 1s;
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), quick, now_));
  EXPECT_FALSE(budget_.TryHold(BodyOf(2 * kMb), quick, now_));
  EXPECT_EQ(connection_->aborts, 1) << "told once";
  EXPECT_EQ(quick->aborts, 0);
  EXPECT_EQ(budget_.stats().cut, 1u);
}

}  // namespace
}  // namespace terrace::server
