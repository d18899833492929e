// The datasets and groups of a recording, for its writer and its reader (docs/recordings.md). Attributes are
// listed in AttributeArchive.h's users. Internal to this module, but for `live`.
#pragma once

namespace smartsurf::record::paths {

inline constexpr const char *kMeta = "meta", *kOptions = "options", *kSet = "set", *kVersions = "versions",
                            *kVary = "vary", *kVaried = "varied", *kExtensions = "extensions",
                            *kLooks = "looks";
inline constexpr const char* kTouchedByHand = "touched_by_hand";  // an attribute that is added during the run

inline constexpr const char *kTick = "tick", *kTime = "time", *kHash = "hash", *kContacts = "contacts";

inline constexpr const char *kObjects = "objects", *kPosition = "objects/position",
                            *kOrientation = "objects/orientation", *kVelocity = "objects/velocity",
                            *kAngularVelocity = "objects/angular_velocity";

inline constexpr const char *kSurface = "surface", *kHeightChanges = "surface/changes",
                            *kMotion = "surface/motion", *kSkinHeight = "surface/skin/height",
                            *kHeight = "surface/height";

inline constexpr const char *kInputs = "inputs", *kInputChanges = "inputs/changes", *kInputValues = "values",
                            *kSensors = "sensors", *kActuators = "actuators", *kMetrics = "metrics",
                            *kRegisters = "registers", *kSolids = "solids", *kClock = "clock";

// What a live recording has beside its channels (Recorder.h, LiveRow): groups and their datasets.
namespace live {
inline constexpr const char *kRoot = "", *kStatus = "status", *kLost = "lost";
inline constexpr const char *kAnswers = "answers", *kAnsweredTick = "tick", *kLatency = "latency_us";
inline constexpr const char *kHostTime = "host_ns", *kBoards = "boards";  // host_ns: of the group kClock
}  // namespace live

// Columns of /objects: one entry per object.
namespace column {
inline constexpr const char *kId = "id", *kLabel = "label", *kShape = "shape", *kMaterial = "material",
                            *kRadius = "radius", *kHeight = "height", *kSolid = "solid",
                            *kExtents = "extents", *kMass = "mass", *kCentreOfMass = "centre_of_mass",
                            *kFixed = "fixed", *kColour = "colour", *kInitialPosition = "initial_position",
                            *kInitialOrientation = "initial_orientation",
                            *kInitialVelocity = "initial_velocity",
                            *kInitialAngularVelocity = "initial_angular_velocity";
}  // namespace column

}  // namespace smartsurf::record::paths
