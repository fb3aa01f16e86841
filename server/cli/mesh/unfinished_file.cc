#include "server/cli/mesh/unfinished_file.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <climits>
#include <csignal>
#include <utility>

#include "engine/core/check.h"

namespace terrace::cli {
namespace {

// Static memory for the signal handler, which may run on any thread.
std::array<char, PATH_MAX> path_of_file{};
std::atomic<bool> has_file = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void RemoveAndEnd(int signal) {
  if (has_file.load()) ::unlink(path_of_file.data());
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

}  // namespace

// Files with longer paths cannot be opened.
UnfinishedFile::UnfinishedFile(std::string path) : path_(std::move(path)) {
  TERRACE_CHECK(!has_file.load());
  if (path_.size() >= path_of_file.size()) return;
  path_.copy(path_of_file.data(), path_.size());
  path_of_file[path_.size()] = '\0';
  has_file.store(true);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    if (::sigaction(number, nullptr, &before) != 0 || before.sa_handler == SIG_IGN) continue;
    ::signal(number, RemoveAndEnd);
  }
}

// After a rename there is no file to remove.
UnfinishedFile::~UnfinishedFile() {
  has_file.store(false);
  ::unlink(path_.c_str());
}

}  // namespace terrace::cli
