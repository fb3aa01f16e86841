#include "server/cli/unfinished_file.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <utility>

#include "engine/core/check.h"

namespace terrace::cli {
namespace {

constexpr std::array<int, 3> kSignals = {SIGINT, SIGTERM, SIGHUP};

std::atomic<const char*> path_of_file = nullptr;
static_assert(std::atomic<const char*>::is_always_lock_free);  // a handler may read it

void RemoveAndEnd(int signal) {
  if (const char* const path = path_of_file.load()) ::unlink(path);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

}  // namespace

UnfinishedFile::UnfinishedFile(std::string path) : path_(std::move(path)) {
  TERRACE_CHECK(path_of_file.load() == nullptr);
  path_of_file.store(path_.c_str());
  for (const int signal : kSignals) {
    if (::signal(signal, RemoveAndEnd) == SIG_IGN) ::signal(signal, SIG_IGN);
  }
}

// Where it was renamed, there is none to remove.
UnfinishedFile::~UnfinishedFile() {
  path_of_file.store(nullptr);
  ::unlink(path_.c_str());
}

}  // namespace terrace::cli
