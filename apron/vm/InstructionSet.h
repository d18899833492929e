// The vector instructions with which array code runs. Results are the same bits with each.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace apron::vm {

enum class InstructionSet : std::uint8_t {
  kPortable,  // kernels for any CPU (SSE, NEON); no code is generated
  kAvx2,
  kAvx512,  // F, BW, CD, DQ and VL
};

// "portable", "avx2" or "avx512".
std::string_view instruction_set_name(InstructionSet isa) noexcept;
// nullopt if no set has this name.
std::optional<InstructionSet> find_instruction_set(std::string_view name) noexcept;

}  // namespace apron::vm
