// A map from body to value. clear() is O(1), also in a world whose bodies sleep: entries carry a version.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

template <class Value>
class BodyMap {
 public:
  // `none`: the value of a body that has not been set.
  explicit BodyMap(Value none) : none_(none) {}

  // Call before the first set(). `bodies`: their number.
  void clear(std::size_t bodies) {
    if (entries_.size() < bodies) entries_.resize(bodies, {0, none_});
    if (++version_ == 0) entries_.assign(entries_.size(), {0, none_}), version_ = 1;
  }
  // 0 before the first clear().
  std::size_t size() const { return entries_.size(); }
  void set(Index body, Value value) { entries_[body] = {version_, value}; }
  Value operator[](Index body) const {
    const Entry& e = entries_[body];
    return e.version == version_ ? e.value : none_;
  }

 private:
  struct Entry {
    std::uint32_t version;
    Value value;
  };
  Value none_;
  std::uint32_t version_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace smartsurf::world
