"""What keywords of Abaqus and CalculiX are to a component: passed over, or refused with advice."""

from __future__ import annotations

_MODEL_FILE = "stated in the model file"
_OUTPUT = "output of the other code"
_MATERIAL = "this property is not used here"

# keywords that change neither mass nor stiffness of a component, and why
PASSED_OVER: dict[str, str] = {
    "HEADING": "a title",
    "PREPRINT": _OUTPUT,
    "RESTART": _OUTPUT,
    "OUTPUT": _OUTPUT,
    "NODEOUTPUT": _OUTPUT,
    "ELEMENTOUTPUT": _OUTPUT,
    "CONTACTOUTPUT": _OUTPUT,
    "NODEPRINT": _OUTPUT,
    "NODEFILE": _OUTPUT,
    "ELPRINT": _OUTPUT,
    "ELFILE": _OUTPUT,
    "CONTACTPRINT": _OUTPUT,
    "CONTACTFILE": _OUTPUT,
    "FILEFORMAT": _OUTPUT,
    "FILTER": _OUTPUT,
    "TIMEPOINTS": _OUTPUT,
    "PHYSICALCONSTANTS": "not used here",
    "SECTIONCONTROLS": "the elements here have no such controls",
    "HOURGLASSSTIFFNESS": "the elements here have no such controls",
    "AMPLITUDE": "loads are " + _MODEL_FILE,
    "BOUNDARY": "supports are " + _MODEL_FILE,
    "INITIALCONDITIONS": "working points are computed",
    "TRANSFORM": "directions of supports and loads are " + _MODEL_FILE,
    "CONTACTPAIR": "contact is " + _MODEL_FILE,
    "CONTACT": "contact is " + _MODEL_FILE,
    "CONTACTINCLUSIONS": "contact is " + _MODEL_FILE,
    "CONTACTEXCLUSIONS": "contact is " + _MODEL_FILE,
    "CONTACTPROPERTYASSIGNMENT": "contact is " + _MODEL_FILE,
    "CONTACTINITIALIZATIONASSIGNMENT": "contact is " + _MODEL_FILE,
    "CONTACTINITIALIZATIONDATA": "contact is " + _MODEL_FILE,
    "SURFACEINTERACTION": "contact is " + _MODEL_FILE,
    "SURFACEBEHAVIOR": "contact is " + _MODEL_FILE,
    "FRICTION": "contact is " + _MODEL_FILE,
    "CLEARANCE": "contact is " + _MODEL_FILE,
    "CONDUCTIVITY": _MATERIAL,
    "SPECIFICHEAT": _MATERIAL,
    "EXPANSION": _MATERIAL,
    "PLASTIC": "vibrations about a working point are elastic",
    "DAMPING": "damping is " + _MODEL_FILE,
}

_MERGE = "merge the nodes of both sides, or make two components of it with a layer or springs"
_COUPLE = "couple components by layers and springs of the model file"
_SOLIDS = "only solids are supported"
_GENERATE = "let the preprocessor write all nodes and elements"

# keywords that change the component and cannot be read, and what to do
REFUSED: dict[str, str] = {
    "CYCLICSYMMETRYMODEL": "write the whole body",
    "KINEMATICCOUPLING": "write *COUPLING with *KINEMATIC",
    "DISTRIBUTINGCOUPLING": "write *COUPLING with *DISTRIBUTING",
    "MPC": _COUPLE,
    "EQUATION": _COUPLE,
    "EMBEDDEDELEMENT": _MERGE,
    "FASTENER": _COUPLE,
    "SPRING": "springs are stated in the model file",
    "DASHPOT": "dampers are stated in the model file",
    "MASS": _SOLIDS,
    "ROTARYINERTIA": _SOLIDS,
    "SHELLSECTION": _SOLIDS,
    "SHELLGENERALSECTION": _SOLIDS,
    "MEMBRANESECTION": _SOLIDS,
    "BEAMSECTION": _SOLIDS,
    "BEAMGENERALSECTION": _SOLIDS,
    "CONNECTORSECTION": _SOLIDS,
    "COHESIVESECTION": _SOLIDS,
    "GASKETSECTION": _SOLIDS,
    "NGEN": _GENERATE,
    "NFILL": _GENERATE,
    "NCOPY": _GENERATE,
    "NMAP": _GENERATE,
    "ELGEN": _GENERATE,
    "ELCOPY": _GENERATE,
    "SYSTEM": "write the nodes in global Cartesian coordinates",
    "PARAMETER": "write numbers in place of parameters",
}

# laws of materials that are not read: elements that have one need the moduli of the model file
OTHER_LAWS = (
    *("HYPERELASTIC", "HYPERFOAM", "USERMATERIAL", "DEFORMATIONPLASTICITY", "HYPOELASTIC"),
    *("MOONEYRIVLIN", "NOTENSION", "NOCOMPRESSION", "LOWDENSITYFOAM", "ANISOTROPICHYPERELASTIC"),
    *("POROUSELASTIC", "CABLE", "FABRIC", "ACOUSTICMEDIUM", "FLUIDCONSTANTS"),
)

# elements that are refused unless `treat_as` says what they are to be
ELEMENTS: dict[str, str] = {
    "C3D8R": "hourglass control is each code's own; mesh with C3D8I or C3D20R",
    "C3D8H": "hybrid elements have pressures as unknowns; C3D8_BBAR is nearest",
    "C3D10M": "the modified tetrahedron is not published; mesh with C3D10",
    "C3D10H": "hybrid elements have pressures as unknowns; C3D10 is nearest",
    "C3D10HS": "hybrid elements have pressures as unknowns; C3D10 is nearest",
    "C3D4H": "hybrid elements have pressures as unknowns; mesh with C3D10",
    "C3D20H": "hybrid elements have pressures as unknowns; C3D20 is nearest",
    "C3D20RH": "hybrid elements have pressures as unknowns; C3D20R is nearest",
}
