#include "apron/compiler/ProgramBuilder.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <utility>

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
    fail(location_, "a register of {}x{} has more than {} cells", shape.width, shape.height,
         program::kMaxCells);
  }
  if (program_.registers.size() >= program::kMaxRegisters) {
    fail(location_, "the program needs more than {} registers", program::kMaxRegisters);
  }
  register_bytes_ += program::stored_bytes(shape.width, shape.height, shape.type);
  if (register_bytes_ > program::kMaxMemoryBytes) {
    fail(location_, "the registers take more than {} bytes: a row of {} cell{} takes {}",
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
  return live_.emplace_back(Value{Value::Kind::kRegister, index, 0.0, true});
}

Value ProgramBuilder::allocate_scalar_temporary() {
  const auto free = take_lowest(free_variables_);
  const std::uint32_t index = free ? *free : add_variable(fmt::format("${}", temporary_count_++));
  return live_.emplace_back(Value{Value::Kind::kScalar, index, 0.0, true});
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
  std::vector<std::uint32_t>& free = value.is_register() ? free_registers_[shape(value)] : free_variables_;
  if (std::ranges::find(free, value.index) == free.end()) free.push_back(value.index);
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
  const program::Register& reg = program_.registers[value.index];
  return {reg.width, reg.height, reg.type};
}

void ProgramBuilder::emit(program::Opcode op, Operand destination, std::vector<Operand> operands,
                          bool masked) {
  if (program_.code.size() + 1 >= program::kMaxInstructions) {
    fail(location_, "the program has more than {} instructions", program::kMaxInstructions);
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
}

bool ProgramBuilder::retarget_last(const Value& temporary, const Value& target) {
  if (!temporary.is_temporary || program_.code.empty() || last_label_position_ == position()) return false;
  program::Instruction& last = program_.code.back();
  const Operand new_destination = operand(target);
  const bool matches = last.destination == operand(temporary) && temporary.kind == target.kind;
  const bool reads_it = std::ranges::find(last.operands, new_destination) != last.operands.end();
  const bool aliases_source = reads_it && program::requires_out_of_place(last.op);
  if (!matches || last.op == program::Opcode::kPixelSet || aliases_source) return false;
  last.destination = new_destination;
  last.masked = !target.is_register() || !unmasked_registers_.contains(target.index);
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
  for (program::Instruction& instruction : program_.code) {
    for (Operand& operand : instruction.operands) {
      if (operand.kind == OperandKind::kLabel) operand.index = labels_[operand.index];
    }
  }
  return std::move(program_);
}

}  // namespace apron::compiler
