// The arrays of one frame in private memory, laid out as in a slot but without the slot header.
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <span>

#include "shm_protocol/layout.h"

namespace shm_protocol {

class FrameArrays {
 public:
  FrameArrays() = default;
  explicit FrameArrays(std::size_t bytes)
      : memory_(static_cast<std::byte*>(::operator new[](bytes + 1, kAlignment))) {
    std::memset(memory_.get(), 0, bytes);
  }

  std::byte* begin() const noexcept { return memory_.get(); }
  std::byte* array(const ssp_channel& c) const noexcept { return begin() + (c.offset - sizeof(ssp_slot)); }
  std::span<std::byte> bytes(const ssp_channel& c) const noexcept {
    return {array(c), static_cast<std::size_t>(c.bytes)};
  }

 private:
  static constexpr std::align_val_t kAlignment{SSP_ARRAY_ALIGNMENT};
  struct AlignedDelete {
    void operator()(std::byte* memory) const noexcept { ::operator delete[](memory, kAlignment); }
  };
  std::unique_ptr<std::byte[], AlignedDelete> memory_;
};

}  // namespace shm_protocol
