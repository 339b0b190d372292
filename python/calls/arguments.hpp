#pragma once

#include "values.hpp"

#include <nanobind/nanobind.h>

namespace xraycast::python {

// Arguments that functions look at themselves, with what type checkers take for them: any object passes.
class ArrayArgument : public nb::object {  ///< see numbers_of
  NB_OBJECT(ArrayArgument, nb::object, "numpy.typing.ArrayLike", always)
};
class PathArgument : public nb::object {  ///< see path_of
  NB_OBJECT(PathArgument, nb::object, "str | os.PathLike[str]", always)
};
class ProgressArgument : public nb::object {  ///< see run_job
  NB_OBJECT(ProgressArgument, nb::object, "xraycast._progress.Listener", always)
};
class VesselsArgument : public nb::object {  ///< see scene_of
  NB_OBJECT(VesselsArgument, nb::object, "Vessels | VesselTree | Mesh | str | os.PathLike[str]", always)
};
class InstrumentsArgument : public nb::object {  ///< see scene_of
  NB_OBJECT(InstrumentsArgument, nb::object,
            "Catheter | CoaxialInstruments | InstrumentShape | "
            "collections.abc.Sequence[Catheter | CoaxialInstruments | InstrumentShape]",
            always)
};
class ObjectsArgument : public nb::object {  ///< see scene_of
  NB_OBJECT(ObjectsArgument, nb::object, "collections.abc.Sequence[Implant]", always)
};
class FluoroscopeArgument : public nb::object {  ///< see fluoroscope_of
  NB_OBJECT(FluoroscopeArgument, nb::object, "Fluoroscope", always)
};
class PicturesArgument : public nb::object {  ///< see told_of in compare.cpp
  NB_OBJECT(PicturesArgument, nb::object,
            "collections.abc.Callable[[int, float, numpy.typing.NDArray[numpy.uint8]], object]", always)
};
class PicturesOfXraysArgument : public nb::object {  ///< see xrays_of
  NB_OBJECT(PicturesOfXraysArgument, nb::object, "collections.abc.Sequence[numpy.typing.ArrayLike]", always)
};
class FramesOfXraysArgument : public nb::object {  ///< see frames_of
  NB_OBJECT(FramesOfXraysArgument, nb::object,
            "collections.abc.Sequence[collections.abc.Sequence[numpy.typing.ArrayLike]]", always)
};
class ModelsArgument : public nb::object {  ///< see make_instruments
  NB_OBJECT(ModelsArgument, nb::object, "collections.abc.Sequence[str | os.PathLike[str]]", always)
};
class EntryArgument : public nb::object {  ///< see run_of
  NB_OBJECT(EntryArgument, nb::object, "int | str | numpy.typing.ArrayLike", always)
};
class PhaseArgument : public nb::object {  ///< see motion_request_of
  NB_OBJECT(PhaseArgument, nb::object, "dict[str, float]", always)
};
class KeysArgument : public nb::object {  ///< see keys_of
  NB_OBJECT(KeysArgument, nb::object, "dict[str, int]", always)
};
class TimeArgument : public nb::object {  ///< see motion_request_of
  NB_OBJECT(TimeArgument, nb::object, "float", always)
};
class NamesArgument : public nb::object {  ///< see stages_of
  NB_OBJECT(NamesArgument, nb::object, "str | collections.abc.Sequence[str]", always)
};

}  // namespace xraycast::python
