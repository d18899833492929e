#include "smartsurf/record/Ownership.h"

#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <mutex>
#include <vector>

namespace smartsurf::record {
namespace {

struct Registry {
  Registry() noexcept {
    ::pthread_atfork([] { get().mutex.lock(); }, [] { get().mutex.unlock(); }, [] { get().enter_child(); });
  }
  // Never destroyed: recorders may outlive static objects.
  static Registry& get() noexcept {
    static Registry& registry = *new Registry;
    return registry;
  }
  void enter_child() noexcept {
    ++forks;
    if (const int nowhere = descriptors.empty() ? -1 : ::open("/dev/null", O_RDWR | O_CLOEXEC);
        nowhere >= 0) {
      for (const int descriptor : descriptors) ::dup3(nowhere, descriptor, O_CLOEXEC);
      ::close(nowhere);
    }
    descriptors.clear();
    mutex.unlock();
  }

  std::mutex mutex;
  unsigned forks = 0;  // of this process and those that it comes from
  std::vector<int> descriptors;
};

}  // namespace

Owner::Owner() noexcept : forks_(Registry::get().forks) {}

bool Owner::is_child() const noexcept { return Registry::get().forks != forks_; }

OwnedDescriptor::OwnedDescriptor(int descriptor) : descriptor_(descriptor) {
  Registry& registry = Registry::get();
  const std::lock_guard lock(registry.mutex);
  registry.descriptors.push_back(descriptor);
}

OwnedDescriptor::~OwnedDescriptor() {
  Registry& registry = Registry::get();
  const std::lock_guard lock(registry.mutex);
  const auto found = std::ranges::find(registry.descriptors, descriptor_);
  if (found != registry.descriptors.end()) registry.descriptors.erase(found);
}

}  // namespace smartsurf::record
