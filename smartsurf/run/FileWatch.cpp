#include "smartsurf/run/FileWatch.h"

#include <sys/stat.h>

#include <string>
#include <utility>

#include "common/files/ReadFile.h"

namespace smartsurf::run {
namespace {
using namespace std::chrono_literals;
constexpr auto kInterval = 100ms, kQuiet = 200ms;
}  // namespace

FileWatch::FileWatch(std::filesystem::path file, std::string_view text)
    : file_(std::move(file)), reported_(read()), last_(reported_) {
  std::string now;
  if (common::read_file(file_, common::kMaxTextBytes, now) || now != text) reported_ = {};
}

bool FileWatch::changed() {
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_at_ < kInterval) return false;
  looked_at_ = now;
  const State state = read();
  if (state != last_) changed_at_ = now;
  last_ = state;
  if (state == reported_ || state == State{} || now - changed_at_ < kQuiet) return false;
  reported_ = state;
  return true;
}

FileWatch::State FileWatch::read() const {
  struct stat status {};
  if (::stat(file_.c_str(), &status) != 0) return {};
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  return {status.st_ino, status.st_size, status.st_mtim.tv_sec * kNanoseconds + status.st_mtim.tv_nsec};
}

}  // namespace smartsurf::run
