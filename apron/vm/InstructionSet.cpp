#include "apron/vm/InstructionSet.h"

#include <algorithm>
#include <array>

namespace apron::vm {
namespace {

constexpr std::array<std::string_view, 3> kNames{"portable", "avx2", "avx512"};

}  // namespace

std::string_view instruction_set_name(InstructionSet isa) noexcept {
  return kNames[static_cast<std::size_t>(isa)];
}

std::optional<InstructionSet> find_instruction_set(std::string_view name) noexcept {
  const auto found = std::ranges::find(kNames, name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<InstructionSet>(found - kNames.begin());
}

}  // namespace apron::vm
