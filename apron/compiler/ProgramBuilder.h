// Assembles a program: instructions, constant tables, labels, and reusable temporaries.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apron/compiler/Lifetimes.h"
#include "apron/program/Program.h"
#include "apron/syntax/SourceManager.h"

namespace apron::compiler {

// The size of a register and the type of its cells.
struct Shape {
  std::uint32_t width = 0, height = 0;
  program::CellType type = program::CellType::kFloat32;

  bool operator==(const Shape&) const = default;
  auto operator<=>(const Shape&) const = default;
  bool is_integer() const noexcept { return program::is_integer(type); }
  bool has_size_of(const Shape& other) const noexcept {
    return width == other.width && height == other.height;
  }
  Shape of_type(program::CellType other) const noexcept { return {width, height, other}; }
};

// The result of an expression.
struct Value {
  enum class Kind : std::uint8_t { kNone, kRegister, kScalar, kConstant };
  Kind kind = Kind::kNone;
  std::uint32_t index = 0;
  double constant = 0.0;
  bool is_temporary = false;

  static Value from_constant(double number) noexcept { return {Kind::kConstant, 0, number, false}; }
  bool is_register() const noexcept { return kind == Kind::kRegister; }
  bool is_constant() const noexcept { return kind == Kind::kConstant; }
};

// An error in the source.
struct CompileError {
  syntax::Location location;
  std::string message;
  bool is_final = false;  // a limit of the whole program is hit
};
// Thrown for a statement that uses a name whose declaration or first write has an error, which is reported
// there.
struct AlreadyReported {};

template <class... Arguments>
[[noreturn]] void fail(syntax::Location location, fmt::format_string<Arguments...> message,
                       Arguments&&... arguments) {
  throw CompileError{location, fmt::format(message, std::forward<Arguments>(arguments)...)};
}
template <class... Arguments>
[[noreturn]] void fail_at_limit(syntax::Location location, fmt::format_string<Arguments...> message,
                                Arguments&&... arguments) {
  throw CompileError{location, fmt::format(message, std::forward<Arguments>(arguments)...), true};
}

class ProgramBuilder {
 public:
  using Label = std::uint32_t;

  // Sets the source location of the following instructions.
  void set_location(const syntax::Location& location, const std::string& file);
  const syntax::Location& location() const noexcept { return location_; }
  // Expansions are added in the order of their numbers, from 0.
  void add_expansion(const syntax::ExpansionInfo& expansion, const std::string& file);
  program::SourceLocation make_source(const syntax::Location& location, const std::string& file);

  // Fail when one of the limits of program/Program.h is hit.
  std::uint32_t add_register(std::string name, Shape);
  std::uint32_t add_variable(std::string name);

  // Temporaries share registers and variables, but one during whose life code outside may run has its own.
  Value allocate_temporary(Shape);
  Value allocate_scalar_temporary();
  void release(const Value&);  // ignores values that are not temporaries
  // Releases the temporaries taken since the mark that are not retained.
  std::size_t mark() const noexcept { return live_.size(); }
  void release_to(std::size_t mark);
  void retain(const Value&);  // until release()
  void unretain(const Value&);
  // Marks where a macro's body begins. A local name that it reads before it writes is 0 from there on.
  std::size_t begin_body();
  void set_local(const Value&, std::size_t body);
  // True if no path from where the body begins leads here twice.
  bool is_straight_since(std::size_t body) const noexcept { return last_label_position_ <= body; }
  // Names the holder of the value, for the message that a recursion would overwrite it.
  void describe(const Value&, std::string description);

  // The first instruction that may find a temporary written; 0 for other values.
  std::size_t written_position(const Value&) const;

  program::Operand operand(const Value&);
  program::Operand literal_operand(double);
  program::Operand text_operand(const std::string&);
  Shape shape(const Value&) const;

  void emit(program::Opcode, program::Operand destination = {}, std::vector<program::Operand> = {},
            bool masked = true);
  // Sets whether instructions that write the register obey masks, until its release. The default is true.
  void obey_masks(const Value& reg, bool);
  // Lets the last instruction write `target` instead of its temporary. Returns false, and changes nothing,
  // unless it wrote all of the temporary, is the only predecessor of this point, and does not read neighbours
  // of `target`.
  bool retarget_last(const Value& temporary, const Value& target);
  std::size_t position() const noexcept { return program_.code.size(); }
  // True if a mask may be in force for the following instructions.
  void set_may_be_masked(bool may_be_masked) noexcept { may_be_masked_ = may_be_masked; }

  Label new_label();
  void bind_label(Label);
  program::Operand label_operand(Label) const;

  // A jump to where something must be open.
  struct Entry {
    std::size_t position = 0;  // of the jump
    syntax::Location location;
    Label target = 0;
    std::size_t opening = 0;
    Label end = 0;
    std::string message;
  };
  // finish() fails if a path from the program's start, or from `end`, leads to the jump without the
  // instruction `opening`.
  void require_opening(Entry entry) { openings_.push_back(std::move(entry)); }
  // finish() fails if a path to the jump leads past the instructions that set what is read at its target.
  void require_values(Entry entry) { values_.push_back(std::move(entry)); }

  program::Program& program() noexcept { return program_; }
  const program::Program& program() const noexcept { return program_; }
  // Ends the code with kEnd, and resolves labels and temporaries.
  program::Program finish();
  // After finish(): the position of an instruction that was at that position.
  std::size_t final_position(std::size_t position) const;

 private:
  void remove_live(const Value&);
  Value add_temporary(std::uint32_t storage, bool is_register);
  std::uint32_t storage(std::uint32_t index) const {
    return (index & kTemporaryBit) != 0 ? temporaries_[index & ~kTemporaryBit].storage : index;
  }
  void resolve_labels();
  std::vector<bool> reached_past(std::size_t opening, std::size_t end) const;
  bool is_jump(const Entry&) const;
  void check_openings() const;
  void check_values(const Lifetimes&) const;
  void check_recursion(const Lifetimes&) const;
  void begin_lives(const Lifetimes&);
  void separate_temporaries(const Lifetimes&);
  void start_locals();
  void resolve_temporaries();
  static std::optional<std::uint32_t> take_lowest(std::vector<std::uint32_t>& free);
  void append(program::Opcode, program::Operand destination, const std::vector<program::Operand>&,
              bool masked);

  program::Program program_;
  syntax::Location location_;
  std::uint64_t register_bytes_ = 0;                        // bytes of all registers
  std::map<std::uint64_t, std::uint32_t> literal_indices_;  // by the bits of the value
  std::map<std::string, std::uint32_t> text_indices_, file_indices_;
  std::map<Shape, std::vector<std::uint32_t>> free_registers_;
  std::vector<std::uint32_t> free_variables_;
  std::set<std::uint32_t> unmasked_registers_;
  std::vector<Value> live_;
  std::vector<Temporary> temporaries_;
  std::map<std::uint32_t, std::string> descriptions_;  // of temporaries
  std::vector<syntax::Location> temporary_locations_;
  std::map<std::size_t, syntax::Location> call_locations_;
  std::vector<Entry> openings_, values_;
  std::vector<std::size_t> bodies_, final_positions_;
  std::vector<bool> keeps_cells_;  // of an instruction: a mask may
  bool may_be_masked_ = false;
  std::vector<std::uint32_t> labels_;
  std::size_t temporary_count_ = 0;
  std::size_t last_label_position_ = 0;  // position of the label placed last
};

}  // namespace apron::compiler
