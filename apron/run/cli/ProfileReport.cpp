#include "apron/run/cli/ProfileReport.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/files/ReadFile.h"
#include "common/text/Words.h"

namespace apron::run {
namespace {

using nlohmann::ordered_json;

// An invalid model; text is for the user.
struct CostModelError {
  std::string text;
};

double read_number(const ordered_json& object, const char* field, double default_value,
                   const std::string& where) {
  if (!object.contains(field)) return default_value;
  const ordered_json& value = object.at(field);
  const double v = value.is_number() ? value.get<double>() : -1.0;
  if (!(v >= 0.0) || !std::isfinite(v))
    throw CostModelError{where + ": '" + field + "' is " + value.dump() +
                         ", but must be a non-negative number"};
  return v;
}

void require_known_fields(const ordered_json& object, std::initializer_list<std::string_view> fields,
                          const std::string& where) {
  if (!object.is_object()) throw CostModelError{where + ": must be an object { … }"};
  for (const auto& [key, value] : object.items())
    if (std::ranges::find(fields, key) == fields.end())
      throw CostModelError{where + ": '" + key + "' is unknown; known: " + common::join(fields)};
}

InstructionCost parse_cost(const ordered_json& object, const std::string& where) {
  require_known_fields(object, {"cycles", "cycles_per_cell", "energy_j", "energy_j_per_cell"}, where);
  return {read_number(object, "cycles", 1.0, where), read_number(object, "cycles_per_cell", 0.0, where),
          read_number(object, "energy_j", 0.0, where), read_number(object, "energy_j_per_cell", 0.0, where)};
}

bool is_mnemonic(const std::string& name) {
  for (std::size_t op = 0; op < program::opcode_count(); ++op)
    if (program::opcode_info(static_cast<program::Opcode>(op)).mnemonic == name) return true;
  return false;
}

CostModel parse_model(const ordered_json& object) {
  require_known_fields(object,
                       {"name", "clock_hz", "idle_w", "default", "instructions", "macros", "frame_macros"},
                       "the model");
  CostModel model;
  if (object.contains("name") && object["name"].is_string()) model.name = object["name"].get<std::string>();
  model.clock_hz = read_number(object, "clock_hz", 0.0, "the model");
  if (!(model.clock_hz > 0.0))
    throw CostModelError{"the model: 'clock_hz' must be positive (cycles per second)"};
  model.idle_w = read_number(object, "idle_w", 0.0, "the model");
  if (object.contains("default")) model.default_cost = parse_cost(object["default"], "'default'");
  if (object.contains("macros")) {
    if (!object["macros"].is_object()) throw CostModelError{"'macros': must be an object { … }"};
    for (const auto& [name, value] : object["macros"].items())
      model.macros[name] = parse_cost(value, "'" + name + "'");
  }
  if (object.contains("frame_macros")) {
    const ordered_json& names = object["frame_macros"];
    const bool valid = names.is_array() && std::all_of(names.begin(), names.end(),
                                                       [](const auto& name) { return name.is_string(); });
    if (!valid) throw CostModelError{"'frame_macros': must be a list of names [ … ]"};
    model.frame_macros = names.get<std::vector<std::string>>();
  }
  if (!object.contains("instructions")) return model;
  if (!object["instructions"].is_object()) throw CostModelError{"'instructions': must be an object { … }"};
  for (const auto& [name, value] : object["instructions"].items()) {
    if (!is_mnemonic(name))
      throw CostModelError{"'instructions': there is no instruction '" + name +
                           "'; apron disasm lists those of a program"};
    model.instructions[name] = parse_cost(value, "'" + name + "'");
  }
  return model;
}

struct ProfileTotals {
  std::uint64_t count = 0, nanoseconds = 0;
  double cycles = 0.0, energy_j = 0.0;

  ProfileTotals& operator+=(const ProfileTotals& other) {
    count += other.count;
    nanoseconds += other.nanoseconds;
    cycles += other.cycles;
    energy_j += other.energy_j;
    return *this;
  }
  void write_json(ordered_json& json, bool with_model) const {
    json["count"] = count;
    json["time_ns"] = nanoseconds;
    if (!with_model) return;
    json["cycles"] = cycles;
    json["energy_j"] = energy_j;
  }
};

// The cells of the instruction's destination register, or else of its first register operand; 0 without one.
double cell_count(const program::Program& program, const program::Instruction& instruction) {
  const auto of = [&](const program::Operand& o) {
    const program::Register& reg = program.registers[o.index];
    return static_cast<double>(reg.width) * reg.height;
  };
  if (instruction.destination.kind == program::OperandKind::kRegister) return of(instruction.destination);
  for (const program::Operand& operand : instruction.operands)
    if (operand.kind == program::OperandKind::kRegister) return of(operand);
  return 0.0;
}

// The model's charge for a macro: the price of its form with that many operands, or of all its forms.
const InstructionCost* macro_cost(const CostModel& model, const program::Expansion& expansion) {
  if (model.macros.empty()) return nullptr;
  auto found = model.macros.find(expansion.macro + "/" + std::to_string(expansion.operand_count));
  if (found == model.macros.end()) found = model.macros.find(expansion.macro);
  return found == model.macros.end() ? nullptr : &found->second;
}

// The outermost expansion around an instruction whose macro the model prices; 0 if there is none.
std::uint32_t priced_expansion(const program::Program& program, std::size_t index, const CostModel& model) {
  std::uint32_t priced = 0;
  std::uint32_t expansion = program.source_locations[program.code[index].source_location].expansion;
  while (expansion != 0) {
    if (macro_cost(model, program.expansions[expansion]) != nullptr) priced = expansion;
    expansion = program.expansions[expansion].call_site.expansion;
  }
  return priced;
}

// Bills each use of a priced macro as one instruction of the machine: its first instruction in the code
// carries the cost of the whole expansion.
class MacroBilling {
 public:
  MacroBilling(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
               const CostModel& model)
      : program_(program), model_(model), first_(program.expansions.size()) {
    if (model.macros.empty()) return;
    for (std::size_t index = 0; index < profile.size(); ++index) {
      const std::uint32_t expansion = priced_expansion(program, index, model);
      if (expansion == 0) continue;
      entries_.resize(profile.size());
      entries_[index] = {expansion, profile[index].executions};
      if (!first_[expansion]) first_[expansion] = index;
    }
    // A body that jumps back to its beginning is still in the same use.
    for (std::size_t index = 0; index < entries_.size(); ++index)
      for (const program::Operand& operand : program.code[index].operands)
        if (const auto first = first_[entries_[index].expansion];
            operand.kind == program::OperandKind::kLabel && first == operand.index)
          entries_[*first].uses -= profile[index].jumps;
  }

  // Returns true if the instruction belongs to a priced macro. Its first instruction gets the cost of all.
  bool bill(std::size_t index, double cells, ProfileTotals& totals) {
    if (entries_.empty() || entries_[index].expansion == 0) return false;
    const Entry& entry = entries_[index];
    if (first_[entry.expansion] != index) return true;
    const std::string& name = program_.expansions[entry.expansion].macro;
    const InstructionCost& cost = *macro_cost(model_, program_.expansions[entry.expansion]);
    const auto times = static_cast<double>(entry.uses);
    totals.cycles = times * (cost.cycles + cost.cycles_per_cell * cells);
    totals.energy_j = times * (cost.energy_j + cost.energy_j_per_cell * cells);
    by_macro_[name] += {entry.uses, totals.nanoseconds, totals.cycles, totals.energy_j};
    return true;
  }

  const std::map<std::string, ProfileTotals>& by_macro() const noexcept { return by_macro_; }
  std::uint64_t frame_count() const {
    std::uint64_t count = 0;
    for (const std::string& name : model_.frame_macros)
      if (const auto found = by_macro_.find(name); found != by_macro_.end()) count += found->second.count;
    return count;
  }

 private:
  struct Entry {
    std::uint32_t expansion = 0;
    std::uint64_t uses = 0;  // of the expansion, by its first instruction
  };
  const program::Program& program_;
  const CostModel& model_;
  std::vector<std::optional<std::size_t>> first_;  // instruction, by expansion
  std::vector<Entry> entries_;
  std::map<std::string, ProfileTotals> by_macro_;
};

ProfileTotals instruction_totals(const program::Program& program, std::size_t index,
                                 const vm::InstructionProfile& profile, const std::optional<CostModel>& model,
                                 MacroBilling* billing, double array_cells) {
  ProfileTotals totals{profile.executions, profile.nanoseconds, 0.0, 0.0};
  if (!model) return totals;
  const program::Instruction& instruction = program.code[index];
  if (billing->bill(index, array_cells, totals)) return totals;
  const auto found = model->instructions.find(std::string(program::opcode_info(instruction.op).mnemonic));
  const InstructionCost& cost = found != model->instructions.end() ? found->second : model->default_cost;
  const auto executions = static_cast<double>(profile.executions);
  totals.cycles = executions * (cost.cycles + cost.cycles_per_cell * cell_count(program, instruction));
  totals.energy_j = executions * (cost.energy_j + cost.energy_j_per_cell * cell_count(program, instruction));
  return totals;
}

ordered_json estimate_json(const ProfileTotals& total, std::uint64_t frame_count, const CostModel& model) {
  ordered_json json;
  const double time_s = total.cycles / model.clock_hz, energy_j = total.energy_j + model.idle_w * time_s;
  json["model"] = model.name;
  json["cycles"] = total.cycles;
  json["time_s"] = time_s;
  json["energy_j"] = energy_j;
  if (frame_count == 0) return json;
  const auto frames = static_cast<double>(frame_count);
  json["per_frame"] = {
      {"cycles", total.cycles / frames}, {"time_s", time_s / frames}, {"energy_j", energy_j / frames}};
  return json;
}

}  // namespace

std::optional<CostModel> read_cost_model(const std::string& file, std::string& error) {
  std::string text;
  if (const std::error_code failure = common::read_file(file, common::kMaxTextBytes, text)) {
    error = file + ": error: cannot be read: " + failure.message();
    return std::nullopt;
  }
  try {
    return parse_model(ordered_json::parse(text, nullptr, true, true));
  } catch (const CostModelError& model_error) {
    error = file + ": error: " + model_error.text;
  } catch (const nlohmann::json::exception& json_error) {
    error = file + ": error: not JSON: " + json_error.what();
  }
  return std::nullopt;
}

std::string profile_json(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
                         std::uint64_t frame_count, const std::optional<CostModel>& model) {
  std::optional<MacroBilling> billing;
  if (model) billing.emplace(program, profile, *model);
  // The machine's registers have the array's size, which is that of the first register.
  const double array_cells = program.registers.empty() ? 0.0
                                                       : static_cast<double>(program.registers[0].width) *
                                                             program.registers[0].height;
  std::map<std::string, ProfileTotals> by_name;
  std::map<std::pair<std::uint32_t, std::uint32_t>, ProfileTotals> by_line;
  ProfileTotals total;
  ordered_json instructions = ordered_json::array();
  for (std::size_t index = 0; index < profile.size(); ++index) {
    if (profile[index].executions == 0) continue;
    const ProfileTotals sum =
        instruction_totals(program, index, profile[index], model, billing ? &*billing : nullptr, array_cells);
    const program::SourceLocation& source = program.source_locations[program.code[index].source_location];
    total += sum;
    by_name[std::string(program::opcode_info(program.code[index].op).mnemonic)] += sum;
    by_line[{source.file, source.line}] += sum;
    ordered_json& entry = instructions.emplace_back();
    entry["index"] = index;
    entry["instruction"] = program::opcode_info(program.code[index].op).mnemonic;
    entry["file"] = program.files[source.file];
    entry["line"] = source.line;
    sum.write_json(entry, model.has_value());
  }
  ordered_json report;
  report["how"] = "one instruction at a time; without --profile instructions run together and faster";
  if (frame_count == 0 && billing) frame_count = billing->frame_count();
  report["frames"] = frame_count;
  total.write_json(report["all"], model.has_value());
  if (model) report["estimate"] = estimate_json(total, frame_count, *model);
  if (billing && !model->macros.empty()) {
    ordered_json& machine = report["machine"];
    ProfileTotals all;
    machine["count"] = 0;
    for (const auto& [name, sum] : billing->by_macro()) {
      all += sum;
      machine["instructions"][name] = {
          {"count", sum.count}, {"cycles", sum.cycles}, {"energy_j", sum.energy_j}};
    }
    machine["count"] = all.count;
    machine["cycles"] = all.cycles;
    machine["energy_j"] = all.energy_j;
  }
  for (const auto& [name, sum] : by_name) sum.write_json(report["instructions"][name], model.has_value());
  for (const auto& [place, sum] : by_line) {
    ordered_json& line = report["lines"].emplace_back();
    line["file"] = program.files[place.first];
    line["line"] = place.second;
    sum.write_json(line, model.has_value());
  }
  report["program"] = std::move(instructions);
  return report.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace apron::run
