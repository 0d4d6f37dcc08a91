"""Cards of Nastran bulk data that a component does not need, so that a whole deck can be read."""

from __future__ import annotations

from squealstudy.models.components.mesh import CONTACT_NOT_READ

MODEL_FILE, STUDY = "stated in the model file", "stated in the study"


def _with_reason(names: str, why: str) -> dict[str, str]:
    return dict.fromkeys(names.split(), why)


# cards that change neither mass nor stiffness, with the reason that is told to the user
PASSED_OVER = {
    **_with_reason("SPC SPC1 SPCADD SPCD SPCOFF SPCR GMSPC", "supports are " + MODEL_FILE),
    **_with_reason(
        "LOAD FORCE FORCE1 FORCE2 MOMENT MOMENT1 MOMENT2 PLOAD PLOAD1 PLOAD2 PLOAD4 PLOADB3 "
        "PLOADX PLOADX1 GRAV ACCEL ACCEL1 RFORCE SLOAD LSEQ LOADCYN LOADCYT DLOAD RLOAD1 RLOAD2 "
        "TLOAD1 TLOAD2 DAREA DELAY DPHASE TIC CLOAD ALOAD DEFORM BOLTFOR BOLTLD GMLOAD ACSRCE "
        "ACPLNW",
        "loads are " + STUDY,
    ),
    **_with_reason(
        "EIGRL EIGR EIGC EIGB EIGP PARAM MDLPRM NXSTRAT FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 "
        "TSTEP TSTEPNL TSTEP1 NLPARM NLPCI NLSTEP NLCNTL NLCNTL2 NLCNTLG NLADAPT RANDPS RANDT1 "
        "TABRND1 TABRNDG RCROSS TABLED1 TABLED2 TABLED3 TABLED4 TABLES1 DTI DYNRED ECHOON "
        "ECHOOFF ITER BCPARA BCTPARA BCTPARM TABSCTL DUMMY SWLDPRM HADCRI",
        "settings are " + STUDY,
    ),
    **_with_reason(
        "TEMP TEMPD TEMPP1 TEMPRB TEMPF TEMPEX TEMPBC", "temperatures are no loads here"
    ),
    **_with_reason(
        "MAT4 MAT5 MATT4 MATT5 CONV CONVM PCONV PCONVM CHBDYE CHBDYG CHBDYP PHBDY QBDY1 QBDY2 "
        "QBDY3 QHBDY QVECT QVOL QBDYN RADBC RADM RADMT RADLST RADMTX RADSET VIEW VIEW3D BDYOR "
        "HTFLOW",
        "heat",
    ),
    **_with_reason(
        "BCTABLE BCTABL1 BCTABLE1 BCTSET BCTADD BCRPARA BCPARA BCONECT BCONPRG BCONPRP BCBODY "
        "BCBODY1 BCBDPRP BCSURF BCPROP BCPROPS BCGRID BCSEG BCHANGE BCMOVE BCAUTOP BCRIGID "
        "BCONTACT BCONTR BEDGE BGSET BGADD BGPARM BCRESULTS BGRESULTS BLSEG BFRIC BWIDTH "
        "BOUTPUT CONTACT PCONT PCONTHT",
        CONTACT_NOT_READ,
    ),
    **_with_reason(
        "DESVAR DRESP1 DRESP2 DRESP3 DCONSTR DCONADD DOPTPRM DVPREL1 DVPREL2 DVMREL1 DVMREL2 "
        "DVCREL1 DVCREL2 DVTREL1 DVTREL2 DVGRID DVSHAP DVBSHAP DVPSURF DLINK DDVAL DSCREEN "
        "DTABLE DTABLE2 DEQATN DTPL DVAR DMRLAW DMNCON GROUP TOPVAR BEADVAR DREPADD DREPEAT "
        "RANDVAR TOMVAR",
        "of an optimisation",
    ),
    **_with_reason(
        "PSHELL PCOMP PCOMPG PSHEAR PBAR PBARL PBCOMP PBEAM PBEAML PBEAM3 PBEND PROD PTUBE "
        "PBUSHT PBUSH1D PBUSH2D PELAST PDAMP PDAMPT PDAMP5 PGAP PMASS PVISC PFAST PWELD "
        "PWSEAM PAABSF PACABS PACBAR PACINF PPLANE PLPLANE PCOHE PAXSYMH PLOTEL PLOTEL3 PLOTEL4 "
        "PLOTEL6 PLOTEL8 BAROR BEAMOR CBARAO MAT2 MAT8 MATT2 MATT8 MAT10 MATORT SHLTHK",
        "of elements that are no solids",
    ),
    **_with_reason(
        "MATS1 MATEP MATF MATVE MATTVE MATVP MATDMG CREEP TABLEST",
        "vibrations about a working point are elastic",
    ),
    **_with_reason(
        "TABDMP1 TABDMP2 CDAMP1 CDAMP2 CDAMP3 CDAMP4 CDAMP5 CVISC DAMPING DAMPGBL SDAMP HYBDAMP",
        "damping is " + MODEL_FILE,
    ),
    **_with_reason(
        "MATT9 MATT11",
        "moduli over temperature: those of the MAT9 or MAT11 itself are taken",
    ),
    **_with_reason(
        "SUPORT SUPORT1 ASET ASET1 BSET BSET1 CSET CSET1 OMIT OMIT1 QSET QSET1 USET USET1 SEQGP "
        "SPOINT EPOINT SESET SETREE SEQSET SEQSET1 SEBSET SECSET EGRID GRIDG VUGRID ABSNMVS "
        "ABSTRCT ACMODL MICPNT PANEL SET3 OUTPUT OUTRCV AECOMP AESURF AEROS AERO CYSYM CYJOIN CYAX "
        "ROTORD ROTORG ROTORSE RSPINR RSPINT",
        "not of the mesh",
    ),
    "AMLREG": "the edge of a fluid",
    "DMIG": "no matrix is added to those of the elements",
}

# cards that give elements a higher order or curved sides: without them the elements would differ
P_ELEMENTS = (*("ADAPT", "PVAL", "PSET", "FEEDGE", "FEFACE", "GMCURV", "GMSURF", "POINT", "PEDGE"),)
