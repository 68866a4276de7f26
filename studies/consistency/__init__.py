"""How honest estimators are."""
