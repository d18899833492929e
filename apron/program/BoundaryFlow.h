// The boundary condition in force at each instruction, as far as the program's text determines it.
#pragma once

#include <optional>
#include <vector>

#include "apron/program/Program.h"

namespace apron::program {

struct BoundaryCondition {
  BoundaryRule rule = BoundaryRule::kZero;
  double value = 0.0;  // a scalar, with kValue
};

// By instruction, before it is executed; nullopt if it depends on the path or on a variable, or no path leads
// there. Labels must be inside the code.
std::vector<std::optional<BoundaryCondition>> boundaries_in_force(const Program&);

struct BoundaryMismatch {
  std::size_t instruction = 0;  // that reads neighbours
  double value = 0.0;
  CellType type = CellType::kFloat32;
};

// The instructions that read neighbours of integers while the boundary's value is a number that is none of
// their cells', on every path.
std::vector<BoundaryMismatch> find_boundary_mismatches(const Program&);

}  // namespace apron::program
