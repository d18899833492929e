// The named entries, of actuators or of sensors: the built-in ones, and those that extensions add.
// Thread-safe. Entries are never removed or changed, so a pointer to one stays valid.
#pragma once

#include <algorithm>
#include <deque>
#include <iterator>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

namespace smartsurf::scene {

template <class Entry>
class Registry {
 public:
  explicit Registry(std::vector<Entry> built_in)
      : entries_(std::make_move_iterator(built_in.begin()), std::make_move_iterator(built_in.end())) {}

  const Entry* find(std::string_view name) const {
    const std::scoped_lock lock(mutex_);
    const auto it = std::ranges::find(entries_, name, &Entry::name);
    return it == entries_.end() ? nullptr : &*it;
  }
  std::vector<const Entry*> all() const {
    const std::scoped_lock lock(mutex_);
    std::vector<const Entry*> pointers;
    for (const Entry& entry : entries_) pointers.push_back(&entry);
    return pointers;
  }
  void add(Entry entry) {
    const std::scoped_lock lock(mutex_);
    entries_.push_back(std::move(entry));
  }

 private:
  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace smartsurf::scene
