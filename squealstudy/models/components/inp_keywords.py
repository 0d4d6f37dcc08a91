"""Keywords of Abaqus and CalculiX that are passed over, or refused with advice."""

from __future__ import annotations

from squealstudy.models.components.mesh import CONTACT_NOT_READ

_MODEL_FILE = "stated in the model file"


def _each(names: str, why: str) -> dict[str, str]:
    return dict.fromkeys(names.split(), why)


# keywords that change neither mass nor stiffness of a component, and why
PASSED_OVER: dict[str, str] = {
    "": "a star alone",
    "HEADING": "a title",
    **_each(
        "PREPRINT RESTART OUTPUT NODEOUTPUT ELEMENTOUTPUT CONTACTOUTPUT ENERGYOUTPUT "
        "MODALOUTPUT INTEGRATEDOUTPUT INTEGRATEDOUTPUTSECTION SURFACESECTION NODEPRINT NODEFILE "
        "ELPRINT ELFILE ENERGYPRINT ENERGYFILE MODALPRINT MODALFILE SECTIONPRINT SECTIONFILE "
        "CONTACTPRINT CONTACTFILE FILEFORMAT FILTER TIMEPOINTS MONITOR PRINT DIAGNOSTICS "
        "ELEMENTMATRIXOUTPUT MATRIXGENERATE MATRIXOUTPUT NOANALYSIS DISPLAYBODY",
        "output of the other code",
    ),
    **_each(
        "STATIC DYNAMIC FREQUENCY BUCKLE VISCO HEATTRANSFER STEADYSTATEDYNAMICS MODALDYNAMIC "
        "COMPLEXFREQUENCY GREEN SENSITIVITY CONTROLS SOLVERCONTROLS SOLUTIONTECHNIQUE NORMAL "
        "COUPLEDTEMPERATURE-DISPLACEMENT UNCOUPLEDTEMPERATURE-DISPLACEMENT ELECTROMAGNETICS CFD "
        "CRACKPROPAGATION HCF SUBSTRUCTUREGENERATE RETAINEDNODALDOFS SUBSTRUCTUREMATRIXOUTPUT "
        "MODELCHANGE SUBMODEL REFINEMESH USEREFINEDMESH GEOMETRICTOLERANCES CORRELATIONLENGTH "
        "ROBUSTDESIGN VALUESATINFINITY INCREMENTATION",
        "how the other code solves",
    ),
    **_each(
        "DESIGNVARIABLES DESIGNRESPONSE OBJECTIVE CONSTRAINT FEASIBLEDIRECTION DESIGNPARAMETER",
        "of an optimisation",
    ),
    "PRE-TENSIONSECTION": "both sides of the cut stay together, as of a tightened bolt",
    "DISTRIBUTIONTABLE": "the keyword that uses a distribution says what its values are",
    "PHYSICALCONSTANTS": "not used here",
    "ACOUSTICWAVEFORMULATION": "not used here",
    **_each(
        "SECTIONCONTROLS HOURGLASSSTIFFNESS BULKVISCOSITY TRANSVERSESHEARSTIFFNESS",
        "the elements here have no such controls",
    ),
    **_each(
        "AMPLITUDE CLOAD DLOAD DSLOAD DFLUX CFLUX DSFLUX FILM SFILM RADIATE SRADIATE "
        "TEMPERATURE CRADIATE CFILM FIELD BASEMOTION INERTIARELIEF PRESSURESTRESS LOADCASE "
        "VIEWFACTOR FILMPROPERTY CAVITYDEFINITION EMISSIVITY MASSFLOW",
        "loads are " + _MODEL_FILE,
    ),
    "BOUNDARY": "supports are " + _MODEL_FILE,
    **_each(
        "INITIALCONDITIONS INITIALSTRAININCREASE",
        "working points are computed",
    ),
    **_each(
        "CONTACTPAIR CONTACT CONTACTINCLUSIONS CONTACTEXCLUSIONS CONTACTPROPERTYASSIGNMENT "
        "CONTACTINITIALIZATIONASSIGNMENT CONTACTINITIALIZATIONDATA CONTACTCONTROLS "
        "CONTACTCONTROLSASSIGNMENT CONTACTFORMULATION CONTACTDAMPING CONTACTINTERFERENCE "
        "CONTACTSTABILIZATION SURFACEINTERACTION SURFACEBEHAVIOR SURFACEPROPERTYASSIGNMENT "
        "SURFACESMOOTHING FRICTION CHANGEFRICTION CHANGESURFACEBEHAVIOR CHANGECONTACTTYPE "
        "CLEARANCE GAPCONDUCTANCE GAPHEATGENERATION GAPRADIATION COHESIVEBEHAVIOR DEBOND",
        CONTACT_NOT_READ,
    ),
    **_each(
        "CONDUCTIVITY SPECIFICHEAT LATENTHEAT EXPANSION ELECTRICALCONDUCTIVITY "
        "MAGNETICPERMEABILITY SPECIFICGASCONSTANT DEPVAR PERMEABILITY DIFFUSIVITY SOLUBILITY "
        "JOULEHEATFRACTION INELASTICHEATFRACTION HEATGENERATION DIELECTRIC PIEZOELECTRIC",
        "this property is not used here",
    ),
    **_each(
        "PLASTIC CHANGEPLASTIC RATEDEPENDENT CYCLICHARDENING CREEP MOHRCOULOMB "
        "MOHRCOULOMBHARDENING DRUCKERPRAGER DRUCKERPRAGERHARDENING CAPPLASTICITY "
        "CASTIRONPLASTICITY CASTIRONCOMPRESSIONHARDENING CASTIRONTENSIONHARDENING POTENTIAL "
        "SWELLING ANNEALTEMPERATURE DAMAGEINITIATION DAMAGEEVOLUTION DAMAGESTABILIZATION "
        "FAILSTRESS FAILSTRAIN TENSILEFAILURE SHEARFAILURE CONCRETE CONCRETEDAMAGEDPLASTICITY "
        "CRUSHABLEFOAM CRUSHABLEFOAMHARDENING VISCOELASTIC VISCOUS MULLINSEFFECT HYSTERESIS",
        "vibrations about a working point are elastic",
    ),
    **_each("DAMPING MODALDAMPING GLOBALDAMPING DAMPINGCONTROLS", "damping is " + _MODEL_FILE),
    **_each(
        "SHELLSECTION SHELLGENERALSECTION MEMBRANESECTION MEMBRANE BEAMSECTION "
        "BEAMGENERALSECTION CONNECTORSECTION CONNECTORBEHAVIOR CONNECTORELASTICITY "
        "CONNECTORDAMPING CONNECTORFRICTION COHESIVESECTION GASKETSECTION GASKETBEHAVIOR "
        "FLUIDSECTION RIGIDSURFACE SURFACESECTION DASHPOT GAP JOINT "
        "USERELEMENT USERSECTION NODALTHICKNESS TRUSSSECTION ACOUSTICINFINITEELEMENT",
        "of elements that are no solids",
    ),
}

_MERGE = "merge the nodes of both sides, or make two components of it with a layer or springs"
_COUPLE = "couple components by layers and springs of the model file"
IN_ASSEMBLY = "state masses and springs in the model file, or write them into the part"
_GENERATE = "let the preprocessor write all nodes and elements"

# keywords that may change the component and are not read, and what to do
REFUSED: dict[str, str] = {
    "KINEMATICCOUPLING": "write *COUPLING with *KINEMATIC",
    **_each("FASTENER NETWORKMPC", _COUPLE),
    **_each("EMBEDDEDELEMENT", _MERGE),
    **_each("NCOPY NMAP ELCOPY", _GENERATE),
    "MATRIXASSEMBLE": "give the whole as K and M in the model file",
    "MATRIXINPUT": "give the whole as K and M in the model file",
    "IMPERFECTION": "write the nodes where they are",
    "CHANGEMATERIAL": "write the material that it has at the working point",
    "CHANGESOLIDSECTION": "write the section that it has at the working point",
}

# laws of materials that are not read: elements that have one need the moduli of the model file
OTHER_LAWS = (
    *("HYPERELASTIC", "HYPERFOAM", "USERMATERIAL", "DEFORMATIONPLASTICITY", "HYPOELASTIC"),
    *("MOONEYRIVLIN", "NOTENSION", "NOCOMPRESSION", "LOWDENSITYFOAM", "ANISOTROPICHYPERELASTIC"),
    *("POROUSELASTIC", "CABLE", "FABRIC", "ACOUSTICMEDIUM", "FLUIDCONSTANTS"),
)

# parameters of keywords that would change the model, and are refused; others are passed over
MATTERS: dict[str, tuple[str, ...]] = {
    "ELEMENT": ("OFFSET", "SOLIDELEMENTNUMBERING"),
    "SURFACE": ("COMBINE", "CROP", "FILLETING"),
    "TIE": ("MULTISTAGE", "TIEDNSET"),
    "CYCLICSYMMETRYMODEL": ("MATRIX",),
    "COUPLING": ("INFLUENCERADIUS", "ROTATIONALCOUPLING"),
    "SOLIDSECTION": ("COMPOSITE",),
    "ORIENTATION": ("LOCALDIRECTIONS",),
    "INSTANCE": ("LIBRARY",),
    "SPRING": ("NONLINEAR", "ORIENTATION", "DEPENDENCIES", "RTOL"),
    "ELASTIC": ("DEPENDENCIES", "COMPRESSIONFACTOR"),
    "DENSITY": ("DEPENDENCIES",),
}

# elements that are passed over, and why
NON_STRUCTURAL_ELEMENTS: dict[str, str] = {
    "D": "of a flow network",
    "GAPUNI": CONTACT_NOT_READ,
}

# elements that are refused, with advice, unless `treat_as` gives their formulation
ELEMENTS: dict[str, str] = {
    "C3D8R": "hourglass control is each code's own; mesh with C3D8I or C3D20R",
    "C3D8H": "hybrid elements have pressures as unknowns; C3D8_BBAR is nearest",
    "C3D10M": "the modified tetrahedron is not published; mesh with C3D10",
    "C3D10H": "hybrid elements have pressures as unknowns; C3D10 is nearest",
    "C3D10HS": "hybrid elements have pressures as unknowns; C3D10 is nearest",
    "C3D4H": "hybrid elements have pressures as unknowns; mesh with C3D10",
    "C3D20H": "hybrid elements have pressures as unknowns; C3D20 is nearest",
    **_each(
        "DC3D4 DC3D6 DC3D8 DC3D10 DC3D15 DC3D20", "it conducts heat alone; C3D.. has its nodes"
    ),
    "C3D20RH": "hybrid elements have pressures as unknowns; C3D20R is nearest",
}
