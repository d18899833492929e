#include "apron/target_c/KernelWriter.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>

namespace apron::target_c {

using program::BoundaryRule;
using program::Opcode;

namespace {

std::array<OperationText, 256> make_operation_texts() {
  std::array<OperationText, 256> texts;
#define APRON_ELEMENTWISE(name, arity, value) \
  texts[static_cast<std::size_t>(Opcode::k##name)] = {#value, false};
#define APRON_MATHEMATICS(name, arity, value) \
  texts[static_cast<std::size_t>(Opcode::k##name)] = {#value, true};
#include "apron/program/elementwise.def"
  return texts;
}

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

// The condition of "as_number(condition)"; empty if the text is not of that form.
std::string condition_of(const std::string& text, const std::string& function) {
  if (!text.starts_with(function + "(") || text.back() != ')') return {};
  return text.substr(function.size() + 1, text.size() - function.size() - 2);
}

}  // namespace

const OperationText& operation_text(Opcode op) {
  static const std::array<OperationText, 256> kTexts = make_operation_texts();
  return kTexts[static_cast<std::size_t>(op)];
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
    else if (word.size() == 1 && word[0] >= 'a' && static_cast<std::size_t>(word[0] - 'a') < operands.size())
      result += operands[static_cast<std::size_t>(word[0] - 'a')];
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
  const char* const name = place.layout.has_margin ? (place.layout.is_truth ? "TRUTHS" : "NUMBERS")
                                                   : (place.layout.is_truth ? "OWN_TRUTHS" : "OWN_NUMBERS");
  return fmt::format("{}({})", name, place.index);
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
      const std::string y = pointer(plane_text(place), place.layout.is_truth ? "uint8_t *" : "float *");
      store(y, place.layout, locals_.at(id));
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

 private:
  struct Local {
    std::string name;
    bool is_truth = false;
  };

  std::string pointer(const std::string& argument, const std::string& type) {
    const std::string key = type + argument;
    if (const auto found = pointers_.find(key); found != pointers_.end()) return found->second;
    const std::string name = fmt::format("p{}", pointers_.size());
    parameters_.push_back(type + name);
    arguments_.push_back(argument);
    return pointers_[key] = name;
  }
  std::string parameter(const std::string& argument, const std::string& type) {
    const std::string key = type + argument;
    if (const auto found = pointers_.find(key); found != pointers_.end()) return found->second;
    const std::string name = fmt::format("s{}", pointers_.size());
    parameters_.push_back(type + " " + name);
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
  std::string own_index() { return index({false, false}); }

  void line(const std::string& text) { lines_ += "      " + text + "\n"; }
  std::string define(bool is_truth, const std::string& value) {
    const std::string name = fmt::format("t{}", local_count_++);
    line(fmt::format("const {} {} = {};", is_truth ? "int" : "float", name, value));
    return name;
  }

  std::string constant(double value) {
    constants_.push_back(static_cast<double>(static_cast<float>(value)));
    return fmt::format("\x01{}\x02", constants_.size() - 1);
  }
  static std::string as_number(const Local& local) {
    return local.is_truth ? "(float)" + local.name : local.name;
  }
  static std::string as_truth(const Local& local) {
    return local.is_truth ? local.name : "(" + local.name + " != 0.0f)";
  }

  const Node& node(NodeId id) const { return region_.nodes[id]; }

  // An operand of a kernel: a local variable, a plane's cell, or a scalar.
  Local operand(NodeId id) {
    if (const auto found = locals_.find(id); found != locals_.end()) return found->second;
    if (node(id).is_scalar()) {
      if (node(id).kind != NodeKind::kLiteral)
        return {parameter("float_of_wide(" + scalars_.at(id) + ")", "const float"), false};
      if (schedule_.is_truth[id]) return {node(id).literal == 0.0 ? "0" : "1", true};
      return {constant(node(id).literal), false};
    }
    const Place& place = step_.places.at(id);
    const std::string from = load_pointer(place);
    const Local local{define(place.layout.is_truth, fmt::format("{}[{}]", from, index(place.layout))),
                      place.layout.is_truth};
    return locals_[id] = local;
  }
  std::string load_pointer(const Place& place) {
    // A plane that the kernel also overwrites keeps one pointer.
    for (const NodeId id : step_.kernel.outputs)
      if (step_.places.at(id) == place)
        return pointer(plane_text(place), place.layout.is_truth ? "uint8_t *" : "float *");
    return pointer(plane_text(place), place.layout.is_truth ? "const uint8_t *" : "const float *");
  }

  void store(const std::string& y, const Layout& layout, const Local& value) {
    line(fmt::format("{}[{}] = {};", y, index(layout),
                     layout.is_truth ? "(uint8_t)" + as_truth(value) : as_number(value)));
  }

  void write_node(NodeId id) {
    const Node& n = node(id);
    switch (n.kind) {
      case NodeKind::kRead: {
        const Place& place = step_.places.at(n.operands[0]);
        std::string at = index(place.layout);
        if (n.dy != 0) at += n.dy < 0 ? " - PITCH" : " + PITCH";
        if (n.dx != 0) at += n.dx < 0 ? " - 1" : " + 1";
        locals_[id] = {define(place.layout.is_truth, fmt::format("{}[{}]", load_pointer(place), at)),
                       place.layout.is_truth};
        return;
      }
      case NodeKind::kSense: {
        const std::string from =
            pointer("s->" + channel_member(writer_.program_.channels[n.index]), "const float *");
        locals_[id] = {define(false, fmt::format("{}[{}]", from, own_index())), false};
        return;
      }
      case NodeKind::kCellX:
        locals_[id] = {define(false, fmt::format("(float)({}->column + c)", state())), false};
        return;
      case NodeKind::kCellY:
        locals_[id] = {define(false, fmt::format("(float)({}->row + r)", state())), false};
        return;
      case NodeKind::kRandom:
        return write_random(id);
      case NodeKind::kActuate: {
        const std::string y = pointer("s->" + channel_member(writer_.program_.channels[n.index]), "float *");
        return store(y, {false, false}, operand(n.operands[0]));
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
    const Local a = operand(n.operands[0]), b = operand(n.operands[1]);
    locals_[id] = {
        define(false, fmt::format("{}((uint32_t)({}->column + c), (uint32_t)({}->row + r), {}, {}, {}, {})",
                                  function, s, s, draw, key, as_number(a), as_number(b))),
        false};
  }

  void write_operation(NodeId id) {
    const Node& n = node(id);
    const OperationText& operation = operation_text(n.op);
    std::vector<Local> from;
    for (const NodeId k : n.operands)
      if (k != kNoNode) from.push_back(operand(k));
    if (schedule_.is_truth[id] && (n.op == Opcode::kCopy || n.op == Opcode::kMin || n.op == Opcode::kMax ||
                                   n.op == Opcode::kMul || n.op == Opcode::kSelect)) {
      std::string value = as_truth(from[0]);
      if (n.op == Opcode::kMin || n.op == Opcode::kMul) value += " & " + as_truth(from[1]);
      if (n.op == Opcode::kMax) value += " | " + as_truth(from[1]);
      if (n.op == Opcode::kSelect) value += " ? " + as_truth(from[1]) + " : " + as_truth(from[2]);
      locals_[id] = {define(true, value), true};
      return;
    }
    std::vector<std::string> numbers;
    for (const Local& local : from) numbers.push_back(as_number(local));
    if (operation.is_mathematics) {
      writer_.mathematics_.insert(n.op);
      if (numbers.size() < 2) numbers.emplace_back("0.0f");
      locals_[id] = {
          define(false, fmt::format("{}({}, {})", mathematics_function(n.op), numbers[0], numbers[1])),
          false};
      return;
    }
    std::string text = operation.value;
    // Truths are conditions themselves.
    for (std::size_t k = 0; k < from.size(); ++k)
      if (from[k].is_truth)
        replace_all(text, fmt::format("is_true({})", "abc"[k]), fmt::format("({}{})", '@', k));
    bool is_truth = false;
    if (const std::string condition = condition_of(text, "as_number"); !condition.empty()) {
      is_truth = true;
      text = condition;
    } else if (const std::string inverse = condition_of(text, "as_inverse_number"); !inverse.empty()) {
      is_truth = true;
      text = "!" + inverse;
    }
    text = expand(text, "cell_", numbers);
    for (std::size_t k = 0; k < from.size(); ++k) replace_all(text, fmt::format("(@{})", k), from[k].name);
    locals_[id] = {define(is_truth, text), is_truth};
  }

  KernelWriter& writer_;
  const Region& region_;
  const RegionSchedule& schedule_;
  const Step& step_;
  const std::map<NodeId, std::string>& scalars_;
  std::map<NodeId, Local> locals_;
  std::map<std::string, std::string> pointers_;
  std::vector<std::string> parameters_, arguments_;
  std::vector<double> constants_;
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
  const auto type = [](const Layout& layout) {
    return std::string(layout.is_truth ? "uint8_t *" : "float *");
  };
  const std::string value = move.from.layout.is_truth == move.to.layout.is_truth ? "{}"
                            : move.to.layout.is_truth                            ? "{} != 0.0f"
                                                                                 : "(float){}";
  const std::string from = fmt::format(fmt::runtime(value), fmt::format("p0[{}]", index(move.from.layout)));
  const std::string body = fmt::format(
      "  int r, c;\n  for (r = 0; r < PROGRAM_ROWS; ++r)\n    for (c = 0; c < PROGRAM_COLUMNS; ++c) p1[{}] = "
      "{};\n",
      index(move.to.layout), from);
  return add_call({"const " + type(move.from.layout) + "p0", type(move.to.layout) + "p1"},
                  {plane_text(move.from), plane_text(move.to)}, body, {});
}

std::size_t KernelWriter::add_imposition(const Region& region, const Step& step,
                                         const std::map<NodeId, std::string>& scalars) {
  const Node& read = region.nodes[step.imposition.read];
  const Place& place = step.places.at(step.imposition.value);
  const Node& value = region.nodes[read.operands[1]];
  const bool by_value = read.rule == BoundaryRule::kValue;
  std::string number = "0";
  if (by_value && value.kind == NodeKind::kLiteral) number = float_text(static_cast<float>(value.literal));
  if (by_value && value.kind != NodeKind::kLiteral)
    number = "float_of_wide(" + scalars.at(read.operands[1]) + ")";
  if (place.layout.is_truth) number = by_value && value.literal != 0.0 ? "1" : "0";
  const char* const rule = by_value                                ? "BY_VALUE"
                           : read.rule == BoundaryRule::kReplicate ? "BY_REPLICATION"
                                                                   : "BY_REFLECTION";
  calls_.push_back(
      {0,
       0,
       {},
       fmt::format("impose_{}(s, {}, MARGIN, {}, {});", place.layout.is_truth ? "truths" : "numbers",
                   plane_text(place), rule, number)});
  return calls_.size() - 1;
}

std::size_t KernelWriter::add_call(std::vector<std::string> parameters, std::vector<std::string> arguments,
                                   const std::string& body, std::vector<double> constants) {
  std::string key = body;
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
      const auto bits = [&](const std::vector<double>& constants) {
        return std::bit_cast<std::uint64_t>(constants[k]);
      };
      const bool same = std::ranges::all_of(shape.constants, [&](const std::vector<double>& other) {
        return bits(other) == bits(shape.constants.front());
      });
      std::string value = float_text(static_cast<float>(shape.constants.front()[k]));
      if (!same) {
        shape.parameter_of[k] = next;
        value = fmt::format("c{}", next++);
        parameters.push_back("const float " + value);
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
    if (shape.parameter_of[k] >= 0)
      arguments.push_back(float_text(static_cast<float>(shape.constants[call.instance][k])));
  return fmt::format("kernel_{}({});", call.shape, fmt::join(arguments, ", "));
}

}  // namespace apron::target_c
