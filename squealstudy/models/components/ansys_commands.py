"""Commands and elements of ANSYS archives that are read or passed over, with the reasons."""

from __future__ import annotations

from squealstudy.models.components.mesh import CONTACT_NOT_READ

MODEL_FILE, STUDY = "stated in the model file", "stated in the study"


def with_reason(names: str, why: str) -> dict[str, str]:
    """Map each name in a text to the reason `why`, for messages."""
    return dict.fromkeys(names.split(), why)


# number of a SOLID -> its nodes, the KEYOPT that chooses its formulation (0: none), formulations by
# the value of that KEYOPT, and KEYOPTs that must be 0
SOLIDS: dict[int, tuple[int, int, dict[int, str], tuple[int, ...]]] = {
    185: (8, 2, {0: "C3D8_BBAR", 2: "C3D8I", 3: "C3D8I"}, (3, 6)),
    186: (20, 2, {0: "C3D20R", 1: "C3D20"}, (3, 6)),
    187: (10, 0, {0: "C3D10"}, (6,)),
    45: (8, 1, {0: "C3D8I", 1: "C3D8"}, (2,)),
    95: (20, 11, {0: "C3D20", 1: "C3D20R"}, ()),
    92: (10, 0, {0: "C3D10"}, ()),
}

# elements that add neither mass nor stiffness to a component, and why
NON_STRUCTURAL_ELEMENTS: dict[int, str] = {
    200: "elements for meshing alone",
    **dict.fromkeys(range(151, 157), "loads are " + STUDY),
    **dict.fromkeys(range(169, 180), CONTACT_NOT_READ),
}
READ = ("ET", "KEYOP", "KEYOPT", "ETBLOCK", "NBLOCK", "EBLOCK", "CMBLOCK", "MP", "MPDATA")
ENDS = ("N", "EN")  # commands that end a block, with the number -1
PASSED_OVER = {  # commands that change neither mass nor stiffness of a component, and why
    **with_reason(
        "D F SF SFE SFEBLOCK SFBLOCK BF BFE BFBLOCK BFEBLOCK BFUNIF ACEL OMEGA DOMEGA CGLOC "
        "CGOMEGA DCGOMG CMOMEGA IC TREF IRLF",
        f"supports are {MODEL_FILE}, loads in the study",
    ),
    **with_reason("ALPHAD BETAD DMPRAT DMPSTR DMPSFREQ MDAMP", "damping is " + MODEL_FILE),
    **with_reason(
        "R RMODIF RLBLOCK RMORE SECTYPE SECDATA SECBLOCK SECOFFSET SECCONTROLS SECCONTROL",
        "solids have no real constants or sections",
    ),
    **with_reason("/UNITS", "units are " + MODEL_FILE),
    **with_reason("LOCAL CSYS", "axes of supports, loads and orthotropic elements"),
}
# commands that CDWRITE writes and that do not bear on a mesh
SETTINGS = with_reason(
    "/COM /PREP7 /NOPR /GO /GOPR /TITLE /STITLE /UIS /SOLU /POST1 /EXIT /CONFIG /BATCH /AUTO "
    "/VIEW /ANG *IF *ELSE *ENDIF *SET *DIM *DEL DOF NUMOFF ANTYPE MODOPT MODCONTROL QRDOPT MXPAND "
    "EXTOPT ERESX TIME KUSE CRPLIM NCNV NEQIT NLGEOM SSTIF PSTRES CNVTOL AUTOTS DELTIM NSUBST KBC "
    "OUTRES OUTPR EQSLV TYPE MAT REAL SECNUM ESYS TSHAP FINISH SAVE NSEL ESEL ALLSEL CMSEL CM "
    "CMGRP SHPP RESCONTROL TUNIF TOFFST MPTEMP ETCONTROL HROPT PSCONTROL TRNOPT HARFRQ HROUT "
    "STEF THOPT DMPOPT EMUNIT TIMINT TINTP CSCIR *PREAD END LUMPM TRNOPT NUMEXP KEYW PMETH "
    "OPNCONTROL LNSRCH PRED CUTCONTROL SOLCONTROL RATE SOLVE LSWRITE LSSOLVE",
    "a setting",
)
