#include "apron/target_c/KernelWriter.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>

namespace apron::target_c {

using program::BoundaryRule;
using program::CellType;
using program::Opcode;

namespace {

std::array<OperationText, 256> make_operation_texts() {
  std::array<OperationText, 256> texts;
#define APRON_ELEMENTWISE(name, arity, value) texts[index_of(Opcode::k##name)] = {#value, false};
#define APRON_MATHEMATICS(name, arity, value) texts[index_of(Opcode::k##name)] = {#value, true};
#define APRON_INTEGER APRON_ELEMENTWISE
#include "apron/program/elementwise.def"
  texts[index_of(Opcode::kAddSaturated)] = {"add_saturated(a, b)", false};
  texts[index_of(Opcode::kSubSaturated)] = {"subtract_saturated(a, b)", false};
  return texts;
}

// The condition of "as_number(condition)"; empty if the text is not of that form.
std::string condition_of(const std::string& text, const std::string& function) {
  if (!text.starts_with(function + "(") || text.back() != ')') return {};
  return text.substr(function.size() + 1, text.size() - function.size() - 2);
}

}  // namespace

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

const OperationText& operation_text(Opcode op) {
  static const std::array<OperationText, 256> kTexts = make_operation_texts();
  return kTexts[index_of(op)];
}

std::string expand(const std::string& text, const std::string& prefix,
                   const std::vector<std::string>& operands) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    if (!is_word(text[i])) {
      result += text[i++];
      continue;
    }
    std::size_t end = i;
    while (end < text.size() && is_word(text[end])) ++end;
    const std::string word = text.substr(i, end - i);
    if (end < text.size() && text[end] == '(')
      result += prefix + word;
    else if (word.size() == 1 && word[0] >= 'a' && word[0] - 'a' < std::ssize(operands))
      result += operands[word[0] - 'a'];
    else
      result += word;
    i = end;
  }
  return result;
}

std::string mathematics_function(Opcode op) {
  return "math_" + std::string(program::opcode_info(op).mnemonic);
}

std::string wide_text(double value) {
  std::string text = "0.0";  // unused where there are no doubles
  if (std::isfinite(value)) text = fmt::format("{:.17g}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  if (!std::isfinite(value))
    return fmt::format("wide_of_bits({:#x}ULL)", std::bit_cast<std::uint64_t>(value));
  return fmt::format("WIDE({:#x}ULL, {})", std::bit_cast<std::uint64_t>(value), text);
}

std::string float_text(float value) {
  if (std::isnan(value)) return "NAN_CELL";
  if (std::isinf(value)) return value < 0.0F ? "-INFINITE_CELL" : "INFINITE_CELL";
  std::string text = fmt::format("{:.9g}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text + "f";
}

std::string plane_text(const Place& place) {
  return fmt::format("{}({})", plane_macro(place.layout), place.index);
}

std::string plane_macro(const Layout& layout) {
  std::string name = layout.has_margin ? "" : "own_";
  name += storage_info(layout.storage).name;
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
  return name;
}

std::string type_prefix(program::CellType type) {
  return program::is_integer(type) ? std::string(program::cell_type_name(type)) + "_" : "cell_";
}

std::string scalar_as_cell(program::CellType type, const std::string& scalar) {
  return fmt::format("{}_of_wide({})", program::cell_type_name(type), scalar);
}

std::string cell_text(program::CellType type, double value) {
  if (!program::is_integer(type)) return float_text(static_cast<float>(value));
  const double held = std::isnan(value) ? 0.0
                                        : std::min(std::max(std::trunc(value), program::lowest_cell(type)),
                                                   program::highest_cell(type));
  // C has no literal of the least int32.
  if (held == program::lowest_cell(CellType::kInt32)) return "(-2147483647L - 1L)";
  return fmt::format("{:.0f}{}", held, type == CellType::kInt32 ? "L" : "U");
}

std::string channel_member(const Channel& channel) {
  std::string name = channel.is_sensor ? "sense_" : "actuate_";
  for (const char c : channel.name)
    if (c != ']') name += is_word(c) && static_cast<unsigned char>(c) < 128 ? c : '_';
  return name;
}

// ---- one kernel ----

class KernelWriter::Body {
 public:
  Body(KernelWriter& writer, const Region& region, const RegionSchedule& schedule, const Step& step,
       const std::map<NodeId, std::string>& scalars)
      : writer_(writer), region_(region), schedule_(schedule), step_(step), scalars_(scalars) {}

  std::size_t write() {
    const Kernel& kernel = step_.kernel;
    for (const NodeId id : kernel.nodes) write_node(id);
    for (const NodeId id : kernel.outputs) {
      const Place& place = step_.places.at(id);
      store(pointer(plane_text(place), mutable_pointer(place.layout)), place.layout, locals_.at(id));
    }
    const std::string range = [&](const char* cells) {
      return kernel.extent == 0 ? fmt::format("= 0; % < {}; ++%", cells)
                                : fmt::format("= -{0}; % < {1} + {0}; ++%", kernel.extent, cells);
    }("PROGRAM_#");
    const auto loop = [&](const char* variable, const char* cells) {
      std::string text = range;
      replace_all(text, "%", variable);
      replace_all(text, "PROGRAM_#", cells);
      return fmt::format("for ({} {})", variable, text);
    };
    std::string text =
        "  int r, c;\n  " + loop("r", "PROGRAM_ROWS") + " {\n    " + loop("c", "PROGRAM_COLUMNS") + " {\n";
    if (uses_at_) text += "      const int at = r * PITCH + c;\n";
    if (uses_own_) text += "      const int own = r * PROGRAM_COLUMNS + c;\n";
    text += lines_ + "    }\n  }\n";
    return writer_.add_call(std::move(parameters_), std::move(arguments_), text, std::move(constants_));
  }
  static std::string mutable_pointer(const Layout& layout) {
    return std::string(storage_info(layout.storage).c_type) + " *";
  }

 private:
  struct Local {
    std::string name;
    bool is_truth = false;
    CellType type = CellType::kFloat32;
  };

  std::string pointer(const std::string& argument, const std::string& type) {
    return add_parameter('p', argument, type);
  }
  std::string parameter(const std::string& argument, const std::string& type) {
    return add_parameter('s', argument, type + " ");
  }
  std::string add_parameter(char prefix, const std::string& argument, const std::string& type) {
    const std::string key = type + argument;
    if (const auto found = pointers_.find(key); found != pointers_.end()) return found->second;
    const std::string name = fmt::format("{}{}", prefix, pointers_.size());
    parameters_.push_back(type + name);
    arguments_.push_back(argument);
    return pointers_[key] = name;
  }
  std::string state() {
    if (pointers_.emplace("s", "s").second) {
      parameters_.insert(parameters_.begin(), "const program_state *s");
      arguments_.insert(arguments_.begin(), "s");
    }
    return "s";
  }
  std::string index(const Layout& layout) {
    (layout.has_margin ? uses_at_ : uses_own_) = true;
    return layout.has_margin ? "at" : "own";
  }
  std::string own_index() { return index({}); }

  void line(const std::string& text) { lines_ += "      " + text + "\n"; }
  Local define(bool is_truth, CellType type, const std::string& value) {
    const std::string name = fmt::format("t{}", local_count_++);
    line(fmt::format("const {} {} = {};", is_truth ? "int" : c_type(type), name, value));
    return {name, is_truth, type};
  }
  static const char* c_type(CellType type) { return storage_info(storage_of(type, false)).c_type; }

  std::string constant(CellType type, double value) {
    constants_.push_back({cell_text(type, value), c_type(type)});
    return fmt::format("\x01{}\x02", constants_.size() - 1);
  }
  static std::string as_number(const Local& local, CellType type) {
    if (local.is_truth ? program::is_integer(type) : local.type == type) return local.name;
    return fmt::format("({}){}", c_type(type), local.name);
  }
  static std::string as_truth(const Local& local) {
    if (local.is_truth) return local.name;
    return fmt::format("({} != {})", local.name, program::is_integer(local.type) ? "0" : "0.0f");
  }

  const Node& node(NodeId id) const { return region_.nodes[id]; }

  // An operand of a kernel: a local variable, a plane's cell, or a scalar as a number of the type.
  Local operand(NodeId id, CellType type = CellType::kFloat32) {
    if (const auto found = locals_.find(id); found != locals_.end()) return found->second;
    if (node(id).is_scalar()) {
      if (node(id).kind != NodeKind::kLiteral)
        return {parameter(scalar_as_cell(type, scalars_.at(id)), std::string("const ") + c_type(type)), false,
                type};
      if (schedule_.is_truth[id]) return {node(id).literal == 0.0 ? "0" : "1", true, type};
      return {constant(type, node(id).literal), false, type};
    }
    const Place& place = step_.places.at(id);
    const std::string from = load_pointer(place);
    return locals_[id] = define(place.layout.is_truth(), node(id).type,
                                fmt::format("{}[{}]", from, index(place.layout)));
  }
  std::string load_pointer(const Place& place) {
    // A plane that the kernel also overwrites keeps one pointer.
    for (const NodeId id : step_.kernel.outputs)
      if (step_.places.at(id) == place) return pointer(plane_text(place), mutable_pointer(place.layout));
    return pointer(plane_text(place), "const " + mutable_pointer(place.layout));
  }

  void store(const std::string& y, const Layout& layout, const Local& value) {
    const StorageInfo info = storage_info(layout.storage);
    const bool converts = layout.is_truth() || (value.is_truth && info.bytes < 4);
    std::string cell = layout.is_truth() ? as_truth(value) : as_number(value, type_of(layout, value.type));
    line(fmt::format("{}[{}] = {}{};", y, index(layout), converts ? fmt::format("({})", info.c_type) : "",
                     cell));
  }

  void write_node(NodeId id) {
    const Node& n = node(id);
    switch (n.kind) {
      case NodeKind::kRead: {
        const Place& place = step_.places.at(n.operands[0]);
        std::string at = index(place.layout);
        if (n.dy != 0) at += n.dy < 0 ? " - PITCH" : " + PITCH";
        if (n.dx != 0) at += n.dx < 0 ? " - 1" : " + 1";
        locals_[id] = define(place.layout.is_truth(), n.type, fmt::format("{}[{}]", load_pointer(place), at));
        return;
      }
      case NodeKind::kSense: {
        const std::string from =
            pointer("s->" + channel_member(writer_.program_.channels[n.index]), "const float *");
        locals_[id] = define(false, n.type, fmt::format("{}[{}]", from, own_index()));
        return;
      }
      case NodeKind::kCellX:
        locals_[id] = define(false, n.type, fmt::format("(float)({}->column + c)", state()));
        return;
      case NodeKind::kCellY:
        locals_[id] = define(false, n.type, fmt::format("(float)({}->row + r)", state()));
        return;
      case NodeKind::kRandom:
        return write_random(id);
      case NodeKind::kActuate: {
        const std::string y = pointer("s->" + channel_member(writer_.program_.channels[n.index]), "float *");
        return store(y, {}, operand(n.operands[0]));
      }
      default:
        return write_operation(id);
    }
  }

  void write_random(NodeId id) {
    const Node& n = node(id);
    const char* const function = n.op == Opcode::kRandomFloat   ? "random_uniform"
                                 : n.op == Opcode::kRandomGauss ? "random_normal"
                                                                : "random_integer";
    writer_.uses_random_integers_ |= n.op == Opcode::kRandomInt;
    const Node& seed = node(n.operands[2]);
    const std::string seed_text = seed.kind == NodeKind::kLiteral
                                      ? float_text(static_cast<float>(seed.literal))
                                      : "float_of_wide(" + scalars_.at(n.operands[2]) + ")";
    const std::string s = state();
    const std::string draw =
        parameter(fmt::format("{}{}ULL", n.draws_follow ? "s->draws + " : "", n.draw), "const uint64_t");
    const std::string key = parameter("bits_of_float(" + seed_text + ")", "const uint32_t");
    const auto bound = [&](std::size_t k) {
      const NodeId at = n.operands[k];
      if (n.op != Opcode::kRandomInt) return as_number(operand(at), n.type);
      return node(at).kind == NodeKind::kLiteral ? wide_text(node(at).literal)
                                                 : parameter(scalars_.at(at), "const wide");
    };
    const std::string a = bound(0), b = bound(1);
    const std::string value =
        fmt::format("{}((uint32_t)({}->column + c), (uint32_t)({}->row + r), {}, {}, {}, {})", function, s, s,
                    draw, key, a, b);
    locals_[id] = define(false, n.type, n.op == Opcode::kRandomInt ? scalar_as_cell(n.type, value) : value);
  }

  void write_operation(NodeId id) {
    const Node& n = node(id);
    const OperationText& operation = operation_text(n.op);
    std::vector<Local> from;
    for (const NodeId k : n.operands)
      if (k != kNoNode) from.push_back(operand(k, n.type));
    const bool converts = n.op == Opcode::kConvert || n.op == Opcode::kConvertSaturated;
    if (const char* const join = truth_join(n.op); schedule_.is_truth[id] && join != nullptr) {
      std::string value = as_truth(from[0]);
      if (n.op == Opcode::kSelect)
        value += " ? " + as_truth(from[1]) + " : " + as_truth(from[2]);
      else if (*join != '\0')
        value += join + as_truth(from[1]);
      locals_[id] = define(true, n.type, value);
      return;
    }
    if (converts) return convert(id, from[0]);
    std::vector<std::string> numbers;
    for (const Local& local : from) numbers.push_back(as_number(local, n.type));
    if (operation.is_mathematics) {
      writer_.mathematics_.insert(n.op);
      if (numbers.size() < 2) numbers.emplace_back("0.0f");
      locals_[id] = define(false, n.type,
                           fmt::format("{}({}, {})", mathematics_function(n.op), numbers[0], numbers[1]));
      return;
    }
    std::string text = operation.value;
    // Truths are conditions themselves, and the operands of a mask's conjunction may differ in type.
    for (std::size_t k = 0; k < from.size(); ++k)
      replace_all(text, fmt::format("is_true({})", "abc"[k]), fmt::format("({}{})", '@', k));
    bool is_truth = false;
    if (const std::string condition = condition_of(text, "as_number"); !condition.empty()) {
      is_truth = true;
      text = condition;
    } else if (const std::string inverse = condition_of(text, "as_inverse_number"); !inverse.empty()) {
      is_truth = true;
      text = "!" + inverse;
    }
    text = expand(text, type_prefix(n.type), numbers);
    for (std::size_t k = 0; k < from.size(); ++k)
      replace_all(text, fmt::format("(@{})", k), as_truth(from[k]));
    locals_[id] = define(is_truth, n.type, text);
  }

  // The C operator for instructions that keep booleans boolean; null for the others.
  static const char* truth_join(Opcode op) {
    switch (op) {
      case Opcode::kCopy:
      case Opcode::kConvert:
      case Opcode::kConvertSaturated:
      case Opcode::kSelect:
        return "";
      case Opcode::kMin:
      case Opcode::kMul:
      case Opcode::kBitAnd:
        return " & ";
      case Opcode::kMax:
      case Opcode::kBitOr:
        return " | ";
      case Opcode::kBitXor:
        return " ^ ";
      default:
        return nullptr;
    }
  }

  void convert(NodeId id, const Local& from) {
    const Node& n = node(id);
    const CellType source = node(n.operands[0]).type;
    std::string value = as_number(from, source);
    if (!program::is_integer(n.type))
      value = fmt::format("(float){}", value);
    else if (!program::is_integer(source))
      value = fmt::format("{}_of_float({})", program::cell_type_name(n.type), value);
    else if (n.op == Opcode::kConvertSaturated)
      value = fmt::format("{}_limit({})", program::cell_type_name(n.type), value);
    else
      value = fmt::format("{}_wrap((uint32_t){})", program::cell_type_name(n.type), value);
    locals_[id] = define(false, n.type, value);
  }

  // The type of a plane that holds the value.
  static CellType type_of(const Layout& layout, CellType type) {
    return layout.is_truth() ? type : static_cast<CellType>(static_cast<int>(layout.storage) - 1);
  }

  KernelWriter& writer_;
  const Region& region_;
  const RegionSchedule& schedule_;
  const Step& step_;
  const std::map<NodeId, std::string>& scalars_;
  std::map<NodeId, Local> locals_;
  std::map<std::string, std::string> pointers_;
  std::vector<std::string> parameters_, arguments_;
  std::vector<Constant> constants_;
  std::string lines_;
  int local_count_ = 0;
  bool uses_at_ = false, uses_own_ = false;
};

std::size_t KernelWriter::add(const Region& region, const RegionSchedule& schedule, const Step& step,
                              const std::map<NodeId, std::string>& scalars) {
  return Body(*this, region, schedule, step, scalars).write();
}

std::size_t KernelWriter::add_move(const Move& move) {
  const auto index = [](const Layout& layout) {
    return layout.has_margin ? "r * PITCH + c" : "r * PROGRAM_COLUMNS + c";
  };
  const std::string to_type = storage_info(move.to.layout.storage).c_type,
                    from_type = storage_info(move.from.layout.storage).c_type;
  std::string from = fmt::format("p0[{}]", index(move.from.layout));
  if (move.from.layout.storage != move.to.layout.storage)
    from = move.to.layout.is_truth() ? from + " != 0" : fmt::format("({}){}", to_type, from);
  const std::string body = fmt::format(
      "  int r, c;\n  for (r = 0; r < PROGRAM_ROWS; ++r)\n    for (c = 0; c < PROGRAM_COLUMNS; ++c) p1[{}] = "
      "{};\n",
      index(move.to.layout), from);
  return add_call({"const " + from_type + " *p0", to_type + " *p1"},
                  {plane_text(move.from), plane_text(move.to)}, body, {});
}

std::size_t KernelWriter::add_imposition(const Region& region, const Step& step,
                                         const std::map<NodeId, std::string>& scalars) {
  const Node& read = region.nodes[step.imposition.read];
  const Place& place = step.places.at(step.imposition.value);
  const Node& value = region.nodes[read.operands[1]];
  const bool by_value = read.rule == BoundaryRule::kValue;
  std::string number = "0";
  if (by_value)
    number = value.kind == NodeKind::kLiteral ? cell_text(read.type, value.literal)
                                              : scalar_as_cell(read.type, scalars.at(read.operands[1]));
  if (place.layout.is_truth()) number = by_value && value.literal != 0.0 ? "1" : "0";
  const char* const rule = by_value                                ? "BY_VALUE"
                           : read.rule == BoundaryRule::kReplicate ? "BY_REPLICATION"
                                                                   : "BY_REFLECTION";
  calls_.push_back({0,
                    0,
                    {},
                    fmt::format("impose_{}(s, {}, MARGIN, {}, {});", storage_info(place.layout.storage).name,
                                plane_text(place), rule, number)});
  return calls_.size() - 1;
}

std::size_t KernelWriter::add_call(std::vector<std::string> parameters, std::vector<std::string> arguments,
                                   const std::string& body, std::vector<Constant> constants) {
  std::string key = body;
  for (const Constant& constant : constants) key += std::string("\n") + constant.c_type;
  for (const std::string& parameter : parameters) key += "\n" + parameter;
  const auto [found, is_new] = index_.try_emplace(key, shapes_.size());
  if (is_new) shapes_.push_back({std::move(parameters), body, {}, {}});
  Shape& shape = shapes_[found->second];
  shape.constants.push_back(std::move(constants));
  calls_.push_back({found->second, shape.constants.size() - 1, std::move(arguments), {}});
  return calls_.size() - 1;
}

std::string KernelWriter::functions() {
  std::string text;
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    Shape& shape = shapes_[i];
    const std::size_t count = shape.constants.front().size();
    std::string body = shape.body;
    std::vector<std::string> parameters = shape.parameters;
    shape.parameter_of.assign(count, -1);
    int next = 0;
    for (std::size_t k = 0; k < count; ++k) {
      auto [value, c_type] = shape.constants.front()[k];
      const bool same = std::ranges::all_of(
          shape.constants, [&](const std::vector<Constant>& other) { return other[k].text == value; });
      if (!same) {
        shape.parameter_of[k] = next;
        value = fmt::format("c{}", next++);
        parameters.push_back(fmt::format("const {} {}", c_type, value));
      }
      replace_all(body, fmt::format("\x01{}\x02", k), value);
    }
    text += fmt::format("static void kernel_{}({}) {{\n{}}}\n\n", i, fmt::join(parameters, ", "), body);
  }
  return text;
}

std::string KernelWriter::call(std::size_t index) const {
  const Call& call = calls_[index];
  if (!call.statement.empty()) return call.statement;
  const Shape& shape = shapes_[call.shape];
  std::vector<std::string> arguments = call.arguments;
  for (std::size_t k = 0; k < shape.parameter_of.size(); ++k)
    if (shape.parameter_of[k] >= 0) arguments.push_back(shape.constants[call.instance][k].text);
  return fmt::format("kernel_{}({});", call.shape, fmt::join(arguments, ", "));
}

}  // namespace apron::target_c
