// Simplifies a closed mesh by edge collapses of least quadric error.
#pragma once

#include <cstddef>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

// A closed mesh of at most `max_triangles` triangles close to the given closed and oriented one, which is
// returned as it is if it has no more. More are left where a collapse would fold the surface or close a hole.
// Deterministic; takes time in proportion to n log n.
//
// M. Garland, P. Heckbert, "Surface simplification using quadric error metrics" (SIGGRAPH 1997), with
// quadrics weighted by area and with the link condition, which keeps walls, handles and shells apart.
TriangleMesh simplified(const TriangleMesh&, std::size_t max_triangles);

}  // namespace smartsurf::mesh
