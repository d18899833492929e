// Lifetimes of temporaries: which of them need storage of their own, are read before they are written, or are
// overwritten by a recursion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "apron/program/Program.h"

namespace apron::compiler {

// Operands of code that is being built name a temporary by its number and this bit.
inline constexpr std::uint32_t kTemporaryBit = 1U << 31U;

struct Temporary {
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::uint32_t storage = 0;  // the register or variable that it has
  bool is_register = false;
  std::size_t first = 0,
              last = kNone;   // instructions of its life, which others of the same storage do not share
  std::size_t entry = kNone;  // of a macro's local name: the instruction where the body begins

  bool starts_at_entry() const noexcept { return first == entry; }
};

class Lifetimes {
 public:
  // Labels are resolved. `keeps_cells`: the instructions that may write only some cells of their destination.
  Lifetimes(const program::Program&, const std::vector<Temporary>&, const std::vector<bool>& keeps_cells);

  // True if code outside may run during its life: it holds a call, or jumps leave it and come back.
  bool is_left(std::uint32_t number) const;
  // True if a path from the entry reads it before it writes it.
  bool is_read_first(std::uint32_t number) const;
  // True if a path from that instruction of its life reads it before it writes it.
  bool is_needed(std::uint32_t number, std::size_t start) const {
    return is_read(number, start, temporaries_[number].first);
  }
  // A call in its life whose routine runs into the call again, which overwrites what is read after it.
  std::optional<std::size_t> find_recursion(std::uint32_t number) const;

 private:
  struct Target {
    std::size_t position, first_source, last_source;  // of the jumps there
  };
  struct Jump {
    std::size_t position, target;
  };

  std::size_t callee(std::size_t call) const { return program_.code[call].operands[0].index; }
  std::vector<std::size_t> find_recursive_calls() const;
  bool reads(std::size_t instruction, std::uint32_t number) const;
  bool overwrites(std::size_t instruction, std::uint32_t number) const;
  bool is_read(std::uint32_t number, std::size_t start, std::size_t low) const;

  const program::Program& program_;
  const std::vector<Temporary>& temporaries_;
  const std::vector<bool>& keeps_cells_;
  std::vector<std::size_t> calls_;
  std::vector<Jump> jumps_;
  std::vector<Target> targets_;
  std::vector<std::size_t> recursive_calls_;
};

}  // namespace apron::compiler
