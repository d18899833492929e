// Makes the engine that a scene asks for.
#pragma once

#include <memory>
#include <string>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/Engine.h"

namespace smartsurf::world {

// True if Bullet was installed when the program was built.
bool has_bullet();

// "" or one clause, as validate(): what the engine of that name cannot do of a valid joint.
std::string validate_for_engine(const scene::JointSpec&, const std::string& engine);

// Throws scene::InputError if this build lacks the engine named by WorldSpec::engine, or if that engine lacks
// something that the scene has.
void require_engine(const scene::SceneSpec&);

// The engine named by WorldSpec::engine, with the scene's objects and joints. `field` and `pool` must outlive
// it; the pool may be null. Throws scene::InputError if this build lacks the engine.
std::unique_ptr<Engine> make_engine(const scene::SceneSpec&, surface::Field& field,
                                    common::ThreadPool* pool = nullptr);

}  // namespace smartsurf::world
