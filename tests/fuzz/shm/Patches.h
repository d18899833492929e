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
  Patches(const std::uint8_t* data, std::size_t size) : remaining_(data, size) {}

  // One byte of the input, 0 at its end.
  std::uint8_t byte() {
    if (remaining_.empty()) return 0;
    const std::uint8_t b = remaining_.front();
    remaining_ = remaining_.subspan(1);
    return b;
  }

  // Applies the next record within `memory`; false when there is none.
  bool apply(std::span<std::byte> memory) {
    if (remaining_.size() < 3 || memory.empty()) return false;
    const std::size_t place = (remaining_[0] | std::size_t{remaining_[1]} << 8) % memory.size();
    std::size_t length = remaining_[2] % 17;
    remaining_ = remaining_.subspan(3);
    length = std::min({length, remaining_.size(), memory.size() - place});
    std::memcpy(&memory[place], remaining_.data(), length);
    remaining_ = remaining_.subspan(length);
    return true;
  }

 private:
  std::span<const std::uint8_t> remaining_;
};

}  // namespace shm_protocol::fuzz
