#include "common/files/UnfinishedFile.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <iterator>
#include <string>

namespace common {
namespace {

// A signal handler may neither lock nor allocate.
struct Slot {
  std::atomic<pid_t> owner{0};
  std::array<char, 1024> path{};
};
constexpr pid_t kFree = 0, kBeingWritten = -1;
constinit std::array<Slot, 16> slots;
constinit std::atomic<void (*)()> at_removal{nullptr};

}  // namespace

UnfinishedFile::UnfinishedFile(const std::filesystem::path& path) noexcept {
  const std::string& text = path.native();
  if (text.size() >= slots[0].path.size()) return;
  for (int i = 0; i < std::ssize(slots); ++i) {
    pid_t expected = kFree;
    if (!slots[i].owner.compare_exchange_strong(expected, kBeingWritten)) continue;
    text.copy(slots[i].path.data(), text.size());
    slots[i].path[text.size()] = '\0';
    slots[i].owner.store(::getpid());
    slot_ = i;
    return;
  }
}

UnfinishedFile::~UnfinishedFile() {
  if (slot_ >= 0) slots[slot_].owner.store(kFree);
}

void remove_unfinished_files() noexcept {
  const pid_t self = ::getpid();
  for (const Slot& slot : slots)
    if (slot.owner.load() == self && ::unlink(slot.path.data()) != 0) ::rmdir(slot.path.data());
  if (auto* const then = at_removal.load()) then();
}

void at_removal_of_unfinished_files(void (*then)()) noexcept { at_removal.store(then); }

}  // namespace common
