#include "apron/compiler/ProgramBuilder.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <iterator>
#include <utility>

#include "apron/program/Reachability.h"

namespace apron::compiler {

using program::Operand;
using program::OperandKind;

program::SourceLocation ProgramBuilder::make_source(const syntax::Location& location,
                                                    const std::string& file) {
  const auto [found, added] =
      file_indices_.try_emplace(file, static_cast<std::uint32_t>(program_.files.size()));
  if (added) program_.files.push_back(file);
  return {found->second, location.line, location.column, location.expansion};
}

void ProgramBuilder::set_location(const syntax::Location& location, const std::string& file) {
  location_ = location;
  const program::SourceLocation entry = make_source(location, file);
  if (program_.source_locations.empty() || program_.source_locations.back() != entry)
    program_.source_locations.push_back(entry);
}

void ProgramBuilder::add_expansion(const syntax::ExpansionInfo& expansion, const std::string& file) {
  program_.expansions.push_back(
      {expansion.macro, make_source(expansion.call, file), expansion.operand_count});
}

std::uint32_t ProgramBuilder::add_register(std::string name, Shape shape) {
  const std::uint64_t cells = std::uint64_t{shape.width} * shape.height;
  if (cells > program::kMaxCells) {
    fail_at_limit(location_, "a register of {}x{} has more than {} cells", shape.width, shape.height,
                  program::kMaxCells);
  }
  if (program_.registers.size() >= program::kMaxRegisters) {
    fail_at_limit(location_, "the program needs more than {} registers", program::kMaxRegisters);
  }
  register_bytes_ += program::stored_bytes(shape.width, shape.height, shape.type);
  if (register_bytes_ > program::kMaxMemoryBytes) {
    fail_at_limit(location_, "the registers take more than {} bytes: a row of {} cell{} takes {}",
                  program::kMaxMemoryBytes, shape.width, shape.width == 1 ? "" : "s",
                  program::stored_row_bytes(shape.width, shape.type));
  }
  program_.registers.push_back({std::move(name), shape.width, shape.height, shape.type});
  return static_cast<std::uint32_t>(program_.registers.size() - 1);
}

std::uint32_t ProgramBuilder::add_variable(std::string name) {
  program_.variables.push_back({std::move(name), 0.0F});
  return static_cast<std::uint32_t>(program_.variables.size() - 1);
}

// The lowest of the free indices is used first, so that programs need few registers.
std::optional<std::uint32_t> ProgramBuilder::take_lowest(std::vector<std::uint32_t>& free) {
  if (free.empty()) return std::nullopt;
  const auto lowest = std::ranges::min_element(free);
  const std::uint32_t index = *lowest;
  free.erase(lowest);
  return index;
}

Value ProgramBuilder::allocate_temporary(Shape shape) {
  const auto free = take_lowest(free_registers_[shape]);
  const std::uint32_t index = free ? *free : add_register(fmt::format("${}", temporary_count_), shape);
  if (!free) ++temporary_count_;
  return add_temporary(index, true);
}

Value ProgramBuilder::allocate_scalar_temporary() {
  const auto free = take_lowest(free_variables_);
  return add_temporary(free ? *free : add_variable(fmt::format("${}", temporary_count_++)), false);
}

Value ProgramBuilder::add_temporary(std::uint32_t storage, bool is_register) {
  const std::uint32_t index = static_cast<std::uint32_t>(temporaries_.size()) | kTemporaryBit;
  temporaries_.push_back({storage, is_register, position()});
  temporary_locations_.push_back(location_);
  return live_.emplace_back(
      Value{is_register ? Value::Kind::kRegister : Value::Kind::kScalar, index, 0.0, true});
}

void ProgramBuilder::remove_live(const Value& value) {
  const auto found = std::find_if(live_.rbegin(), live_.rend(), [&](const Value& live) {
    return live.kind == value.kind && live.index == value.index;
  });
  if (found != live_.rend()) live_.erase(std::next(found).base());
}

void ProgramBuilder::release(const Value& value) {
  if (!value.is_temporary) return;
  remove_live(value);
  Temporary& temporary = temporaries_[value.index & ~kTemporaryBit];
  if (temporary.last != Temporary::kNone) return;
  temporary.last = position();
  (value.is_register() ? free_registers_[shape(value)] : free_variables_).push_back(temporary.storage);
}

void ProgramBuilder::release_to(std::size_t mark) {
  while (live_.size() > mark) release(Value(live_.back()));
}

void ProgramBuilder::retain(const Value& value) {
  if (value.is_temporary) remove_live(value);
}

void ProgramBuilder::unretain(const Value& value) {
  if (value.is_temporary) live_.push_back(value);
}

std::size_t ProgramBuilder::begin_body() {
  append(program::Opcode::kNop, {}, {}, true);
  return bodies_.emplace_back(position() - 1);
}

void ProgramBuilder::set_local(const Value& value, std::size_t body) {
  temporaries_[value.index & ~kTemporaryBit].entry = body;
}

void ProgramBuilder::describe(const Value& value, std::string description) {
  if (value.is_temporary) descriptions_[value.index & ~kTemporaryBit] = std::move(description);
}

std::size_t ProgramBuilder::written_position(const Value& value) const {
  const bool is_stored = value.is_register() || value.kind == Value::Kind::kScalar;
  return is_stored && (value.index & kTemporaryBit) != 0
             ? temporaries_[value.index & ~kTemporaryBit].first + 1
             : 0;
}

Operand ProgramBuilder::operand(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kRegister:
      return {OperandKind::kRegister, value.index};
    case Value::Kind::kScalar:
      return {OperandKind::kVariable, value.index};
    case Value::Kind::kConstant:
      return literal_operand(value.constant);
    case Value::Kind::kNone:
      break;
  }
  return {};
}

Operand ProgramBuilder::literal_operand(double value) {
  const auto next = static_cast<std::uint32_t>(program_.literals.size());
  const auto [found, added] = literal_indices_.try_emplace(std::bit_cast<std::uint64_t>(value), next);
  if (added) program_.literals.push_back(value);
  return {OperandKind::kLiteral, found->second};
}

Operand ProgramBuilder::text_operand(const std::string& value) {
  const auto [found, added] =
      text_indices_.try_emplace(value, static_cast<std::uint32_t>(program_.texts.size()));
  if (added) program_.texts.push_back(value);
  return {OperandKind::kText, found->second};
}

Shape ProgramBuilder::shape(const Value& value) const {
  if (!value.is_register()) return {};
  const program::Register& reg = program_.registers[storage(value.index)];
  return {reg.width, reg.height, reg.type};
}

void ProgramBuilder::emit(program::Opcode op, Operand destination, std::vector<Operand> operands,
                          bool masked) {
  if (program_.code.size() - bodies_.size() + 1 >= program::kMaxInstructions) {
    fail_at_limit(location_, "the program has more than {} instructions", program::kMaxInstructions);
  }
  append(op, destination, operands, masked);
}

void ProgramBuilder::append(program::Opcode op, Operand destination, const std::vector<Operand>& operands,
                            bool masked) {
  const std::size_t locations = std::max<std::size_t>(program_.source_locations.size(), 1);
  const bool is_unmasked =
      destination.kind == OperandKind::kRegister && unmasked_registers_.contains(destination.index);
  program_.code.push_back(
      {op, masked && !is_unmasked, static_cast<std::uint32_t>(locations - 1), destination, {}});
  std::ranges::copy(operands, program_.code.back().operands.begin());
  keeps_cells_.push_back(program_.code.back().masked && may_be_masked_ &&
                         destination.kind == OperandKind::kRegister);
  if (op == program::Opcode::kCall) call_locations_[position() - 1] = location_;
}

bool ProgramBuilder::retarget_last(const Value& temporary, const Value& target) {
  if (!temporary.is_temporary || program_.code.empty() || last_label_position_ == position()) return false;
  program::Instruction& last = program_.code.back();
  const Operand new_destination = operand(target);
  const bool matches = last.destination == operand(temporary) && temporary.kind == target.kind;
  const bool reads_it = std::ranges::any_of(last.operands, [&](const Operand& read) {
    return read.kind == new_destination.kind && storage(read.index) == storage(new_destination.index);
  });
  const bool aliases_source = reads_it && program::requires_out_of_place(last.op);
  if (!matches || last.op == program::Opcode::kPixelSet || aliases_source) return false;
  last.destination = new_destination;
  last.masked = !target.is_register() || !unmasked_registers_.contains(target.index);
  keeps_cells_.back() = last.masked && may_be_masked_ && target.is_register();
  return true;
}

void ProgramBuilder::obey_masks(const Value& reg, bool obeys) {
  if (obeys)
    unmasked_registers_.erase(reg.index);
  else
    unmasked_registers_.insert(reg.index);
}

ProgramBuilder::Label ProgramBuilder::new_label() {
  labels_.push_back(0);
  return static_cast<Label>(labels_.size() - 1);
}

void ProgramBuilder::bind_label(Label label) {
  labels_[label] = static_cast<std::uint32_t>(program_.code.size());
  last_label_position_ = program_.code.size();
}

Operand ProgramBuilder::label_operand(Label label) const { return {OperandKind::kLabel, label}; }

program::Program ProgramBuilder::finish() {
  append(program::Opcode::kEnd, {}, {}, true);
  resolve_labels();
  check_openings();
  const Lifetimes lifetimes(program_, temporaries_, keeps_cells_);
  begin_lives(lifetimes);
  check_values(lifetimes);
  check_recursion(lifetimes);
  separate_temporaries(lifetimes);
  start_locals();
  resolve_temporaries();
  return std::move(program_);
}

void ProgramBuilder::resolve_labels() {
  for (program::Instruction& instruction : program_.code)
    for (Operand& operand : instruction.operands)
      if (operand.kind == OperandKind::kLabel) operand.index = labels_[operand.index];
}

// The instructions that paths from the program's start and from `end` reach, up to the opening.
std::vector<bool> ProgramBuilder::reached_past(std::size_t opening, std::size_t end) const {
  return program::walk(program_.code.size(), {0, end}, [&](std::size_t at) {
    return at == opening ? std::vector<std::size_t>{} : program::successors(program_, at);
  });
}

// False for a condition that never holds.
bool ProgramBuilder::is_jump(const Entry& entry) const {
  return std::ranges::any_of(program_.code[entry.position].operands, [&](const Operand& operand) {
    return operand == Operand{OperandKind::kLabel, labels_[entry.target]};
  });
}

// The compiler's own jumps enter no loop.
void ProgramBuilder::check_openings() const {
  std::map<std::size_t, std::vector<bool>> reached;  // by the opening
  for (const Entry& entry : openings_) {
    const bool is_inside = entry.opening < entry.position && entry.position < labels_[entry.end];
    if (is_inside || !is_jump(entry)) continue;
    const auto [found, added] = reached.try_emplace(entry.opening);
    if (added) found->second = reached_past(entry.opening, labels_[entry.end]);
    if (found->second[entry.position]) fail(entry.location, "{}", entry.message);
  }
}

void ProgramBuilder::check_values(const Lifetimes& lifetimes) const {
  for (const Entry& entry : values_) {
    const std::size_t target = labels_[entry.target];
    if (!is_jump(entry)) continue;
    for (std::uint32_t number = 0; number < temporaries_.size(); ++number) {
      const auto& [storage, is_register, first, last, body] = temporaries_[number];
      const bool is_inside = first <= entry.position && entry.position < last;
      if (is_inside || target <= first || target >= last || !lifetimes.is_needed(number, target)) continue;
      if (!reached_past(first, last)[entry.position]) continue;
      const auto found = descriptions_.find(number);
      fail(entry.location, "{} leads past line {}, which sets {}", entry.message,
           temporary_locations_[number].line,
           found != descriptions_.end() ? found->second : "a part of an expression");
    }
  }
}

void ProgramBuilder::check_recursion(const Lifetimes& lifetimes) const {
  for (std::uint32_t number = 0; number < temporaries_.size(); ++number) {
    const std::optional<std::size_t> call = lifetimes.find_recursion(number);
    if (!call) continue;
    const auto found = descriptions_.find(number);
    fail(call_locations_.at(*call),
         "this call leads back to itself, and {} of line {} keeps one value for all depths of the recursion: "
         "hold it in an array, with an element for each depth",
         found != descriptions_.end() ? found->second : "an expression", temporary_locations_[number].line);
  }
}

// A local name that starts at 0 lives from there on, before the program names it.
void ProgramBuilder::begin_lives(const Lifetimes& lifetimes) {
  for (std::uint32_t number = 0; number < temporaries_.size(); ++number)
    if (lifetimes.is_read_first(number)) temporaries_[number].first = temporaries_[number].entry;
}

// No two temporaries of a storage live at the same time, and one that code outside may overwrite has its own.
void ProgramBuilder::separate_temporaries(const Lifetimes& lifetimes) {
  std::map<bool, std::map<std::uint32_t, std::map<std::size_t, std::size_t>>> lives;  // first to last
  const auto move_to_new = [&](std::uint32_t number) {
    Temporary& temporary = temporaries_[number];
    location_ = temporary_locations_[number];
    const std::string name = fmt::format("${}", temporary_count_++);
    const Value value{Value::Kind::kRegister, temporary.storage};
    temporary.storage = temporary.is_register ? add_register(name, shape(value)) : add_variable(name);
  };
  for (std::uint32_t number = 0; number < temporaries_.size(); ++number) {
    if (lifetimes.is_left(number)) {
      move_to_new(number);
      continue;
    }
    const Temporary& temporary = temporaries_[number];
    auto& shared = lives[temporary.is_register][temporary.storage];
    if (!temporary.starts_at_entry()) shared[temporary.first] = temporary.last;
  }
  for (std::uint32_t number = 0; number < temporaries_.size(); ++number) {
    Temporary& temporary = temporaries_[number];
    if (!temporary.starts_at_entry() || lifetimes.is_left(number)) continue;
    auto& storages = lives[temporary.is_register];
    // The instruction after its life may read it, and may write only what shared the storage before.
    const auto is_free = [&](std::uint32_t storage, const auto& others) {
      const auto after = storage == temporary.storage ? others.lower_bound(temporary.last)
                                                      : others.upper_bound(temporary.last);
      return after == others.begin() || std::prev(after)->second <= temporary.first;
    };
    const auto shape_of = [&](std::uint32_t storage) {
      return temporary.is_register ? shape({Value::Kind::kRegister, storage}) : Shape{};
    };
    const auto fits = [&](const auto& candidate) {
      return shape_of(candidate.first) == shape_of(temporary.storage) &&
             is_free(candidate.first, candidate.second);
    };
    if (!is_free(temporary.storage, storages[temporary.storage])) {
      const auto found = std::ranges::find_if(storages, fits);
      if (found != storages.end())
        temporary.storage = found->first;
      else
        move_to_new(number);
    }
    storages[temporary.storage][temporary.first] = temporary.last;
  }
}

// Local names start at 0 in place of the mark where their body begins.
void ProgramBuilder::start_locals() {
  std::map<std::size_t, std::vector<std::uint32_t>> started;
  for (std::uint32_t number = 0; number < temporaries_.size(); ++number)
    if (temporaries_[number].starts_at_entry()) started[temporaries_[number].entry].push_back(number);
  std::vector<program::Instruction> code;
  code.reserve(program_.code.size());
  const Operand zero = started.empty() ? Operand{} : literal_operand(0.0);
  auto body = bodies_.begin();
  for (const program::Instruction& instruction : program_.code) {
    final_positions_.push_back(code.size());
    if (body == bodies_.end() || *body != final_positions_.size() - 1) {
      code.push_back(instruction);
      continue;
    }
    for (const std::uint32_t number : started[*body++]) {
      const Value value{temporaries_[number].is_register ? Value::Kind::kRegister : Value::Kind::kScalar,
                        number | kTemporaryBit};
      code.push_back({program::Opcode::kCopy, false, instruction.source_location, operand(value), {zero}});
    }
  }
  program_.code = std::move(code);
  for (program::Instruction& instruction : program_.code)
    for (Operand& operand : instruction.operands)
      if (operand.kind == OperandKind::kLabel)
        operand.index = static_cast<std::uint32_t>(final_position(operand.index));
  for (program::LocalName& local : program_.local_names) {
    local.first = static_cast<std::uint32_t>(final_position(local.first));
    local.last = static_cast<std::uint32_t>(final_position(local.last));
  }
}

std::size_t ProgramBuilder::final_position(std::size_t position) const {
  return position < final_positions_.size() ? final_positions_[position] : program_.code.size();
}

void ProgramBuilder::resolve_temporaries() {
  const auto resolve = [&](Operand& operand) {
    if (operand.kind == OperandKind::kRegister || operand.kind == OperandKind::kVariable)
      operand.index = storage(operand.index);
  };
  for (program::Instruction& instruction : program_.code) {
    resolve(instruction.destination);
    std::ranges::for_each(instruction.operands, resolve);
  }
  for (program::LocalName& local : program_.local_names) {
    resolve(local.operand);
    std::ranges::for_each(local.elements, resolve);
  }
  for (program::OperandGroup& group : program_.groups)
    for (std::uint32_t& member : group.members) member = storage(member);
}

}  // namespace apron::compiler
