#include "tests/fuzz/apron/ProgramCodec.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace fuzz {
namespace {

using namespace apron::program;

// visit_program() defines the format once: ByteReader fills the program, ByteWriter serialises it.
class ByteReader {
 public:
  ByteReader(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  template <class Number>
  void number(Number& to, int bytes) {
    std::uint32_t n = 0;
    for (int i = 0; i < bytes; ++i) n |= std::uint32_t{next()} << (8 * i);
    to = static_cast<Number>(n);
  }
  void real(float& to) {
    std::uint32_t bits = 0;
    number(bits, 4);
    to = std::bit_cast<float>(bits);
  }
  void real(double& to) {
    float narrow = 0.0F;
    real(narrow);
    to = narrow;
  }
  // Limits the count to the remaining bytes, which bounds allocations.
  template <class Items>
  void count(Items& items) {
    std::uint16_t n = 0;
    number(n, 2);
    items.resize(std::min<std::size_t>(n, size_ - position_));
  }

 private:
  std::uint8_t next() { return position_ < size_ ? data_[position_++] : std::uint8_t{0}; }

  const std::uint8_t* data_;
  std::size_t size_, position_ = 0;
};

class ByteWriter {
 public:
  template <class Number>
  void number(const Number& from, int bytes) {
    const auto n = static_cast<std::uint32_t>(from);
    for (int i = 0; i < bytes; ++i) bytes_.push_back(static_cast<std::uint8_t>(n >> (8 * i)));
  }
  void real(const float& from) { number(std::bit_cast<std::uint32_t>(from), 4); }
  void real(const double& from) { real(static_cast<float>(from)); }
  template <class Items>
  void count(const Items& items) {
    number(items.size(), 2);
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

template <class Bytes, class Text>
void text(Bytes& bytes, Text& text) {
  bytes.count(text);
  for (auto& c : text) bytes.number(c, 1);
}

template <class Bytes, class Items, class Each>
void list(Bytes& bytes, Items& items, const Each& each) {
  bytes.count(items);
  for (auto& item : items) each(item);
}

template <class Bytes, class Item>
void instruction(Bytes& bytes, Item& in) {
  bytes.number(in.op, 1);
  bytes.number(in.masked, 1);
  bytes.number(in.source_location, 2);
  const auto operand = [&](auto& o) {
    bytes.number(o.kind, 1);
    bytes.number(o.index, 2);
  };
  operand(in.destination);
  for (auto& o : in.operands) operand(o);
}

template <class Bytes, class Whole>
void names(Bytes& bytes, Whole& program) {
  const auto one_text = [&](auto& t) { text(bytes, t); };
  list(bytes, program.texts, one_text);
  list(bytes, program.modules, [&](auto& module) { text(bytes, module.name); });
  list(bytes, program.files, one_text);
  list(bytes, program.source_locations, [&](auto& s) {
    bytes.number(s.file, 2);
    bytes.number(s.line, 2);
    bytes.number(s.column, 2);
  });
  list(bytes, program.parameters, [&](auto& p) {
    text(bytes, p.name);
    bytes.real(p.default_value);
    bytes.real(p.low);
    bytes.real(p.high);
  });
}

template <class Bytes, class Whole>
void visit_program(Bytes& bytes, Whole& program) {
  list(bytes, program.code, [&](auto& in) { instruction(bytes, in); });
  list(bytes, program.registers, [&](auto& r) {
    text(bytes, r.name);
    bytes.number(r.width, 4);
    bytes.number(r.height, 4);
  });
  list(bytes, program.variables, [&](auto& v) {
    text(bytes, v.name);
    bytes.real(v.initial_value);
  });
  list(bytes, program.literals, [&](auto& l) { bytes.real(l); });
  list(bytes, program.filters, [&](auto& f) {
    text(bytes, f.name);
    bytes.number(f.width, 2);
    bytes.number(f.height, 2);
    list(bytes, f.coefficients, [&](auto& e) { bytes.real(e); });
  });
  list(bytes, program.groups, [&](auto& g) {
    text(bytes, g.name);
    bytes.number(g.is_variable_group, 1);
    list(bytes, g.members, [&](auto& e) { bytes.number(e, 2); });
  });
  names(bytes, program);
}

}  // namespace

Program decode(const std::uint8_t* data, std::size_t size) {
  Program program;
  ByteReader reader(data, size);
  visit_program(reader, program);
  return program;
}

std::vector<std::uint8_t> encode(const Program& program) {
  ByteWriter writer;
  visit_program(writer, program);
  return writer.take();
}

}  // namespace fuzz
