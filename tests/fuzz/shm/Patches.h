// How the fuzzers' input changes bytes: records of { u16 place, u8 length, length bytes }, applied one after
// the other. So the corpus is small and a mutation changes one field.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace shm_protocol::fuzz {

class Patches {
 public:
  Patches(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  // One byte of the input, 0 at its end.
  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const std::uint8_t b = rest_.front();
    rest_ = rest_.subspan(1);
    return b;
  }

  // Applies the next record within `memory`; false when there is none.
  bool apply(std::span<std::byte> memory) {
    if (rest_.size() < 3 || memory.empty()) return false;
    const std::size_t place = (rest_[0] | std::size_t{rest_[1]} << 8) % memory.size();
    std::size_t length = rest_[2] % 17;
    rest_ = rest_.subspan(3);
    length = std::min({length, rest_.size(), memory.size() - place});
    std::memcpy(&memory[place], rest_.data(), length);
    rest_ = rest_.subspan(length);
    return true;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace shm_protocol::fuzz
