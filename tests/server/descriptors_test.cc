// The budget of file descriptors: for every limit, the sum of the parts is at most the limit.
#include "server/descriptors.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <string>

#include "server/store/record_db.h"

namespace terrace::server {
namespace {

// Computes the sum independently, with every part at its maximum: each thread that uses a source has it and its
// overviews open.
std::size_t MostOf(const DescriptorDemand& demand, const DescriptorBudget& budget, std::size_t in_use) {
  const std::size_t threads = demand.worker_threads + 2;
  const std::size_t of_loops = 3 * demand.io_threads, of_listening = 2, of_signals = 2, of_proj = 1, passing = 1;
  const std::size_t of_stores = demand.stores * (RecordDb::kOtherDescriptors + budget.store_files);
  return in_use + of_loops + of_listening + of_signals + of_proj + passing + (demand.access_log_file ? 1 : 0) +
         (demand.stores > 0 ? 1 : 0) + of_stores + 2 * threads + 2 * budget.open_sources +
         (demand.has_vrts ? budget.vrt_parts : 0) + budget.connections;
}

TEST(Descriptors, EverybodyGetsWhatTheConfigurationSaysWhereThereAreEnough) {
  const DescriptorDemand demand{2, 16, true, 2, 256, 256, true, 1024};
  const auto budget = SplitDescriptors(demand, 65'536, 8);
  ASSERT_TRUE(budget) << budget.error().message;
  EXPECT_EQ(budget->connections, 1024u);
  EXPECT_EQ(budget->open_sources, 256u);
  EXPECT_GE(budget->store_files, 256u);
  EXPECT_LE(MostOf(demand, *budget, 8), 65'536u);
}

TEST(Descriptors, PartsNeverComeToMoreThanTheLimit) {
  std::mt19937 random(4);
  const auto below = [&](std::size_t bound) { return random() % bound; };
  int split = 0, refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    DescriptorDemand demand;
    demand.io_threads = 1 + static_cast<unsigned>(below(8));
    demand.worker_threads = 1 + static_cast<unsigned>(below(32));
    demand.access_log_file = below(2) == 1;
    demand.stores = below(3);
    demand.store_files = demand.stores > 0 ? 10 + below(2000) : 0;
    demand.open_sources = below(2000);
    demand.has_vrts = below(2) == 1;
    demand.connections = 1 + below(20'000);
    const std::size_t limit = 16 + below(i % 2 == 0 ? 300 : 30'000), in_use = 3 + below(10);
    const auto budget = SplitDescriptors(demand, limit, in_use);
    if (!budget) {
      ++refused;
      continue;
    }
    ++split;
    EXPECT_GE(budget->connections, std::min<std::size_t>(demand.connections, 4));
    EXPECT_LE(budget->connections, demand.connections);
    EXPECT_LE(budget->open_sources, demand.open_sources);
    EXPECT_GE(budget->store_files, RecordDb::kMinOpenFiles);
    const std::size_t least = MostOf(demand, {RecordDb::kMinOpenFiles, 0, 2 * (demand.worker_threads + 2), 4}, in_use);
    EXPECT_LE(MostOf(demand, *budget, in_use), std::max(limit, least)) << i;
  }
  EXPECT_GT(split, 1000);
  EXPECT_GT(refused, 1000);
}

TEST(Descriptors, TooFewAreRefusedWithWhatIsNeededAndTheRemedy) {
  const DescriptorDemand demand{2, 2, false, 2, 256, 256, false, 1024};
  std::size_t limit = 30;
  while (!SplitDescriptors(demand, limit, 3)) ++limit;
  EXPECT_LE(limit, 80u) << "two stores are served with 80";
  const auto refused = SplitDescriptors(demand, limit - 1, 3);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find(std::to_string(limit) + " at least"), std::string::npos);
  EXPECT_NE(refused.error().message.find("ulimit -n"), std::string::npos);
}

TEST(Descriptors, CountsThoseThatAreOpen) {
  const std::size_t before = CountOpenDescriptors();
  const int copy = ::dup(0);
  EXPECT_EQ(CountOpenDescriptors(), before + 1);
  ::close(copy);
  EXPECT_EQ(CountOpenDescriptors(), before);
}

}  // namespace
}  // namespace terrace::server
