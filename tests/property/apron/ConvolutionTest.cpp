// The library's convolve(y, x, w, inputs, side) has the bits of a plain loop, for random numbers of planes,
// kernels and arrays of random sizes, three boundary conditions, every instruction set, fused or not.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

struct Layer {
  int width, height, inputs, outputs, side;
  std::string boundary;
};

// The index that the boundary condition reads for index i of n, or -1 for a zero.
int inside(int i, int n, const std::string& boundary) {
  if (i >= 0 && i < n) return i;
  if (boundary == "zero") return -1;
  if (boundary == "replicate") return std::clamp(i, 0, n - 1);
  return ((i % n) + n) % n;
}

Cells convolved(const Layer& layer, const std::vector<Cells>& x, const std::vector<float>& w, int output) {
  Cells y;
  for (int row = 0; row < layer.height; ++row)
    for (int column = 0; column < layer.width; ++column) {
      float sum = 0.0F;
      const float* weight = &w[static_cast<std::size_t>(output * layer.inputs * layer.side * layer.side)];
      for (int j = 0; j < layer.inputs; ++j)
        for (int v = 0; v < layer.side; ++v)
          for (int u = 0; u < layer.side; ++u) {
            const int at_row = inside(row + v - (layer.side - 1) / 2, layer.height, layer.boundary);
            const int at_column = inside(column + u - (layer.side - 1) / 2, layer.width, layer.boundary);
            const bool is_there = at_row >= 0 && at_column >= 0;
            const auto cell = static_cast<std::size_t>(at_row * layer.width + at_column);
            sum += *weight++ * (is_there ? x[static_cast<std::size_t>(j)][cell] : 0.0F);
          }
      y.push_back(sum);
    }
  return y;
}

std::string source_of(const Layer& layer, const std::vector<float>& w) {
  std::string text =
      fmt::format("!include('filters.aps')\n!register(x[{}], y[{}])\n!scalar(w[{}])\nboundary('{}')\n",
                  layer.inputs, layer.outputs, w.size(), layer.boundary);
  for (std::size_t i = 0; i < w.size(); ++i) text += fmt::format("w[{}] = {}\n", i, w[i]);
  return text + fmt::format("convolve(y, x, w, {}, {})\n", layer.inputs, layer.side);
}

program::Program compile_layer(const Layer& layer, const std::string& text) {
  syntax::MemoryReader reader;
  reader.files["main.aps"] = text;
  reader.files["filters.aps"] = syntax::DiskReader().read(APRON_SCRIPTS "/filters.aps").value_or("");
  syntax::SourceOptions options;
  options.file = "main.aps";
  options.width = static_cast<std::uint32_t>(layer.width);
  options.height = static_cast<std::uint32_t>(layer.height);
  compiler::CompileResult compiled = compiler::compile(options, reader);
  EXPECT_TRUE(compiled.program) << syntax::format_diagnostics(compiled.diagnostics, compiled.sources) << text;
  return compiled.program ? std::move(*compiled.program) : program::Program{};
}

TEST(Convolution, MatchesAPlainLoop) {
  std::uniform_real_distribution<float> real(-2.0F, 2.0F);
  static const char* const kBoundaries[] = {"zero", "replicate", "wrap"};
  const auto seeds = program_seeds(40);
  for (const unsigned seed : seeds) {
    std::mt19937 rng(seed);
    const auto below = [&rng](unsigned n) { return static_cast<int>(rng() % n); };
    const Layer layer{5 + below(60), 5 + below(20), 1 + below(4),
                      1 + below(6),  1 + below(5),  kBoundaries[seed % 3]};
    std::vector<Cells> x(static_cast<std::size_t>(layer.inputs),
                         Cells(static_cast<std::size_t>(layer.width * layer.height)));
    for (Cells& plane : x) std::ranges::generate(plane, [&] { return real(rng); });
    std::vector<float> w(static_cast<std::size_t>(layer.outputs * layer.inputs * layer.side * layer.side));
    std::ranges::generate(w, [&] { return real(rng); });
    const std::string text = source_of(layer, w);
    const program::Program program = compile_layer(layer, text);
    for (const bool fused : {false, true})
      for (const InstructionSet isa :
           {InstructionSet::kAvx512, InstructionSet::kAvx2, InstructionSet::kPortable}) {
        if (!is_supported(isa)) continue;
        FakeHost host;
        VmOptions options;
        options.fusion.enabled = fused;
        options.isa = isa;
        Vm vm(program, options, host);
        const auto plane = [&](const std::string& name) {
          const auto named = [&](const auto& one) { return one.name == name; };
          return vm.plane(static_cast<std::size_t>(std::ranges::find_if(program.registers, named) -
                                                   program.registers.begin()));
        };
        for (std::size_t j = 0; j < x.size(); ++j) write_cells(plane(fmt::format("x[{}]", j)), x[j]);
        ASSERT_EQ(vm.run(), Status::kEnded) << vm.error() << text;
        for (int k = 0; k < layer.outputs; ++k) {
          const Cells want = convolved(layer, x, w, k), got = read_cells(plane(fmt::format("y[{}]", k)));
          for (std::size_t i = 0; i < want.size(); ++i)
            ASSERT_TRUE(bits_equal(want[i], got[i]))
                << "seed " << seed << ", y[" << k << "], cell " << i << text;
        }
      }
  }
  count_cases(seeds.size());
}

}  // namespace
}  // namespace apron::vm::test
