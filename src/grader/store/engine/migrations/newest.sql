CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);

CREATE TABLE audit (
	id INTEGER NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	at DATETIME NOT NULL, 
	actor VARCHAR(32), 
	name VARCHAR(200) NOT NULL, 
	action VARCHAR(40) NOT NULL, 
	subject VARCHAR(200) NOT NULL, 
	detail TEXT NOT NULL, 
	PRIMARY KEY (id)
);

CREATE TABLE content_files (
	sha256 VARCHAR(64) NOT NULL, 
	body BLOB NOT NULL, 
	PRIMARY KEY (sha256)
);

CREATE TABLE content_in_use (
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	digest VARCHAR(80) NOT NULL, 
	PRIMARY KEY (course, quiz)
);

CREATE TABLE content_manifests (
	digest VARCHAR(80) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	files TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (digest)
);

CREATE TABLE course_links (
	course VARCHAR(200) NOT NULL, 
	code VARCHAR(40) NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (course), 
	UNIQUE (code)
);

CREATE TABLE "credentials" (
	id VARCHAR(32) NOT NULL, 
	kind VARCHAR(10) NOT NULL, 
	secret_hash VARCHAR(64) NOT NULL, 
	user VARCHAR(200) NOT NULL, 
	role VARCHAR(20) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	created_at DATETIME NOT NULL, 
	expires_at DATETIME, 
	revoked_at DATETIME, 
	last_used_at DATETIME, 
	member VARCHAR(32) NOT NULL, 
	scopes TEXT, 
	created_by VARCHAR(200), platform INTEGER, label VARCHAR(200), home VARCHAR(32), 
	PRIMARY KEY (id), 
	CONSTRAINT fk_credentials_member FOREIGN KEY(member) REFERENCES members (id)
);

CREATE TABLE destinations (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	kind VARCHAR(10) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	url TEXT, 
	secret VARCHAR(80), 
	old_secret VARCHAR(80), 
	old_until DATETIME, 
	created_by VARCHAR(200) NOT NULL, 
	created_at DATETIME NOT NULL, 
	disabled_at DATETIME, 
	why_disabled TEXT, 
	PRIMARY KEY (id)
);

CREATE TABLE events (
	submission_id VARCHAR(32) NOT NULL, 
	number INTEGER NOT NULL, 
	name VARCHAR(20) NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (submission_id, number), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE extensions (
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	due DATETIME, 
	until DATETIME, 
	attempts INTEGER NOT NULL, 
	granted_by VARCHAR(200) NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (course, quiz, learner)
);

CREATE TABLE idempotency_keys (
	course VARCHAR(200) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	"key" VARCHAR(255) NOT NULL, 
	request_digest VARCHAR(64) NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	http_status INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (course, learner, "key"), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE installation_facts (
	name VARCHAR(40) NOT NULL, 
	value TEXT NOT NULL, 
	PRIMARY KEY (name)
);

CREATE TABLE installation_secrets (
	name VARCHAR(40) NOT NULL, 
	value BLOB NOT NULL, 
	PRIMARY KEY (name)
);

CREATE TABLE jobs (
	id INTEGER NOT NULL, 
	topic VARCHAR(20) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	priority INTEGER NOT NULL, 
	share BIGINT NOT NULL, 
	round INTEGER NOT NULL, 
	tries INTEGER NOT NULL, 
	owner INTEGER, 
	lease VARCHAR(32), 
	delayed_at FLOAT, 
	due_at FLOAT, 
	PRIMARY KEY (id)
);

CREATE TABLE line_comments (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	line INTEGER, 
	text TEXT NOT NULL, 
	author VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (id), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE line_items (
	id VARCHAR(32) NOT NULL, 
	container TEXT NOT NULL, 
	resource TEXT NOT NULL, 
	url TEXT, 
	leased_until DATETIME, 
	PRIMARY KEY (id)
);

CREATE TABLE lti_contexts (
	id INTEGER NOT NULL, 
	platform INTEGER NOT NULL, 
	deployment_id VARCHAR(255) NOT NULL, 
	context_id VARCHAR(255) NOT NULL, 
	title VARCHAR(200) NOT NULL, 
	course VARCHAR(200), 
	wanted VARCHAR(200), 
	wanted_by VARCHAR(200), 
	members_url TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (id), 
	CONSTRAINT uq_lti_contexts_context UNIQUE (platform, deployment_id, context_id), 
	FOREIGN KEY(platform) REFERENCES lti_platforms (id)
);

CREATE TABLE lti_deployments (
	platform INTEGER NOT NULL, 
	deployment_id VARCHAR(255) NOT NULL, 
	created_at DATETIME NOT NULL, 
	approved_at DATETIME, 
	PRIMARY KEY (platform, deployment_id), 
	FOREIGN KEY(platform) REFERENCES lti_platforms (id)
);

CREATE TABLE lti_platforms (
	id INTEGER NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	issuer VARCHAR(255) NOT NULL, 
	client_id VARCHAR(255) NOT NULL, 
	login_url TEXT NOT NULL, 
	token_url TEXT NOT NULL, 
	keys_url TEXT NOT NULL, 
	token_audience TEXT NOT NULL, 
	origins TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	approved_at DATETIME, 
	PRIMARY KEY (id), 
	CONSTRAINT uq_lti_platforms_client UNIQUE (issuer, client_id)
);

CREATE TABLE lti_resource_links (
	id INTEGER NOT NULL, 
	context INTEGER NOT NULL, 
	link_id VARCHAR(255) NOT NULL, 
	quiz VARCHAR(64), 
	question VARCHAR(64), 
	line_item_url TEXT NOT NULL, 
	line_items_url TEXT NOT NULL, 
	scopes TEXT NOT NULL, 
	PRIMARY KEY (id), 
	CONSTRAINT uq_lti_resource_links_link UNIQUE (context, link_id), 
	FOREIGN KEY(context) REFERENCES lti_contexts (id)
);

CREATE TABLE lti_users (
	context INTEGER NOT NULL, 
	subject VARCHAR(255) NOT NULL, 
	member VARCHAR(32) NOT NULL, 
	seen_at DATETIME NOT NULL, 
	PRIMARY KEY (context, subject), 
	FOREIGN KEY(context) REFERENCES lti_contexts (id), 
	FOREIGN KEY(member) REFERENCES members (id)
);

CREATE TABLE members (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	account VARCHAR(210), 
	role VARCHAR(20) NOT NULL, 
	created_at DATETIME NOT NULL, 
	removed_at DATETIME, namespace VARCHAR(64), external_id VARCHAR(255), email VARCHAR(254), home VARCHAR(32), named_by VARCHAR(200), 
	PRIMARY KEY (id), 
	CONSTRAINT uq_members_account UNIQUE (course, account)
);

CREATE TABLE outbox (
	id INTEGER NOT NULL, 
	destination VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	state VARCHAR(10) NOT NULL, 
	version INTEGER NOT NULL, 
	noted_at DATETIME NOT NULL, 
	has_job BOOLEAN NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at DATETIME, 
	sent_at DATETIME, 
	error TEXT, 
	timestamp DATETIME, 
	sent TEXT, 
	tried TEXT, 
	forced BOOLEAN NOT NULL, 
	PRIMARY KEY (id), 
	CONSTRAINT uq_outbox UNIQUE (destination, learner, quiz, question), 
	FOREIGN KEY(destination) REFERENCES destinations (id)
);

CREATE TABLE policy_changes (
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	changes TEXT NOT NULL, 
	changed_by VARCHAR(200) NOT NULL, 
	changed_at DATETIME NOT NULL, 
	PRIMARY KEY (course, quiz)
);

CREATE TABLE publications (
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	published_by VARCHAR(200) NOT NULL, 
	published_at DATETIME NOT NULL, 
	PRIMARY KEY (course, quiz)
);

CREATE TABLE regrade_items (
	regrade_id VARCHAR(32) NOT NULL, 
	number INTEGER NOT NULL, 
	place INTEGER NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	outcome VARCHAR(20) NOT NULL, 
	tries INTEGER NOT NULL, 
	old_status VARCHAR(20), 
	old_points FLOAT, 
	new_status VARCHAR(20), 
	new_points FLOAT, 
	counted_before FLOAT, 
	counted_after FLOAT, 
	PRIMARY KEY (regrade_id, number), 
	FOREIGN KEY(regrade_id) REFERENCES regrades (id)
);

CREATE TABLE regrades (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64), 
	scope TEXT NOT NULL, 
	dry_run BOOLEAN NOT NULL, 
	content_digest VARCHAR(80) NOT NULL, 
	status VARCHAR(20) NOT NULL, 
	reason TEXT, 
	counts TEXT, 
	created_by VARCHAR(200) NOT NULL, 
	created_at DATETIME NOT NULL, 
	finished_at DATETIME, 
	PRIMARY KEY (id)
);

CREATE TABLE result_revisions (
	id INTEGER NOT NULL, 
	position BIGINT, 
	course VARCHAR(200) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	attempt INTEGER, 
	points FLOAT NOT NULL, 
	max_points FLOAT NOT NULL, 
	is_late BOOLEAN NOT NULL, 
	is_final BOOLEAN NOT NULL, 
	revision INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	PRIMARY KEY (id), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE results (
	course VARCHAR(200) NOT NULL, 
	learner VARCHAR(32) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	attempt INTEGER, 
	points FLOAT NOT NULL, 
	max_points FLOAT NOT NULL, 
	is_late BOOLEAN NOT NULL, 
	is_final BOOLEAN NOT NULL, 
	revision INTEGER NOT NULL, 
	first_status VARCHAR(20) NOT NULL, 
	first_option INTEGER, 
	first_value FLOAT, 
	diagnoses TEXT NOT NULL, 
	changes INTEGER NOT NULL, first_several TEXT, 
	PRIMARY KEY (course, learner, quiz, question), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE review_claims (
	submission_id VARCHAR(32) NOT NULL, 
	reviewer VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	expires_at DATETIME NOT NULL, 
	PRIMARY KEY (submission_id), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE reviews (
	submission_id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	reviewer VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	points FLOAT NOT NULL, 
	rubric VARCHAR(32), 
	second VARCHAR(10) NOT NULL, 
	second_reviewer VARCHAR(32), 
	second_name VARCHAR(200), 
	second_points FLOAT, 
	second_ticked TEXT, 
	second_comment TEXT, 
	PRIMARY KEY (submission_id), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TABLE saved_comments (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	text TEXT NOT NULL, 
	saved_by VARCHAR(200) NOT NULL, 
	saved_at DATETIME NOT NULL, 
	PRIMARY KEY (id)
);

CREATE TABLE "submissions" (
	id VARCHAR(32) NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	user VARCHAR(200) NOT NULL, 
	quiz VARCHAR(64) NOT NULL, 
	question VARCHAR(64) NOT NULL, 
	answer TEXT NOT NULL, 
	seed BIGINT, 
	content_digest VARCHAR(80) NOT NULL, 
	status VARCHAR(20) NOT NULL, 
	attempt INTEGER NOT NULL, 
	uses_attempt BOOLEAN NOT NULL, 
	revision INTEGER NOT NULL, 
	version INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, 
	learner VARCHAR(32) NOT NULL, outcome VARCHAR(20), 
	PRIMARY KEY (id)
);

CREATE TABLE tickets (
	hash VARCHAR(64) NOT NULL, 
	purpose VARCHAR(20) NOT NULL, 
	body TEXT NOT NULL, 
	expires_at DATETIME NOT NULL, 
	PRIMARY KEY (hash)
);

CREATE TABLE tried_copies (
	submission_id VARCHAR(32) NOT NULL, 
	original VARCHAR(32) NOT NULL, 
	PRIMARY KEY (submission_id), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id), 
	FOREIGN KEY(original) REFERENCES submissions (id)
);

CREATE TABLE verdicts (
	id INTEGER NOT NULL, 
	submission_id VARCHAR(32) NOT NULL, 
	revision INTEGER NOT NULL, 
	cause VARCHAR(20) NOT NULL, 
	status VARCHAR(20) NOT NULL, 
	points FLOAT NOT NULL, 
	max_points FLOAT NOT NULL, 
	course VARCHAR(200) NOT NULL, 
	seed BIGINT, 
	content_digest VARCHAR(80) NOT NULL, 
	body TEXT NOT NULL, 
	created_at DATETIME NOT NULL, reviewer VARCHAR(200), 
	PRIMARY KEY (id), 
	UNIQUE (submission_id, revision), 
	FOREIGN KEY(submission_id) REFERENCES submissions (id)
);

CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;

CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit WHEN NOT (COALESCE(NEW.id, 0) = COALESCE(OLD.id, 0) AND COALESCE(NEW.course, '') = COALESCE(OLD.course, '') AND COALESCE(NEW.at, OLD.at) = COALESCE(OLD.at, OLD.at) AND COALESCE(NEW.actor, '') = COALESCE(OLD.actor, '') AND COALESCE(NEW.action, '') = COALESCE(OLD.action, '') AND (NEW.name = OLD.name OR NEW.name LIKE 'erased-%') AND (NEW.subject = OLD.subject OR NEW.subject LIKE 'erased-%') AND (NEW.detail = OLD.detail OR NEW.detail = '{}')) BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;

CREATE INDEX ix_audit_course ON audit (course, id);

CREATE INDEX ix_credentials_course ON credentials (course, kind);

CREATE INDEX ix_credentials_expires_at ON credentials (kind, expires_at);

CREATE INDEX ix_credentials_home ON credentials (home) WHERE home IS NOT NULL;

CREATE INDEX ix_credentials_member ON credentials (member);

CREATE INDEX ix_destinations_course ON destinations (course, id);

CREATE INDEX ix_idempotency_keys_created_at ON idempotency_keys (created_at);

CREATE INDEX ix_jobs_order ON jobs (priority, round, share, id) WHERE owner IS NULL;

CREATE INDEX ix_jobs_owner ON jobs (owner) WHERE owner IS NOT NULL;

CREATE INDEX ix_jobs_share ON jobs (share, priority, round) WHERE owner IS NULL;

CREATE INDEX ix_line_comments_submission ON line_comments (submission_id, id);

CREATE INDEX ix_lti_contexts_course ON lti_contexts (course);

CREATE INDEX ix_lti_contexts_wanted ON lti_contexts (wanted);

CREATE INDEX ix_lti_resource_links_quiz ON lti_resource_links (quiz, context);

CREATE INDEX ix_lti_users_member ON lti_users (member);

CREATE INDEX ix_members_home ON members (home) WHERE home IS NOT NULL;

CREATE INDEX ix_members_name ON members (course, name);

CREATE INDEX ix_outbox_course ON outbox (course, state, id);

CREATE INDEX ix_outbox_learner ON outbox (course, learner);

CREATE INDEX ix_outbox_open ON outbox (state) WHERE state <> 'sent';

CREATE INDEX ix_regrade_items_outcome ON regrade_items (regrade_id, outcome, number);

CREATE INDEX ix_regrade_items_place ON regrade_items (regrade_id, place);

CREATE INDEX ix_regrades_course ON regrades (course, id);

CREATE UNIQUE INDEX ix_result_revisions_feed ON result_revisions (course, position);

CREATE INDEX ix_result_revisions_new ON result_revisions (course, id) WHERE position IS NULL;

CREATE INDEX ix_results_quiz ON results (course, quiz, learner, question, changes, points, is_final);

CREATE INDEX ix_reviews_rubric ON reviews (quiz, question, rubric);

CREATE INDEX ix_reviews_second ON reviews (course, second, submission_id);

CREATE INDEX ix_saved_comments_question ON saved_comments (course, quiz, question, id);

CREATE INDEX ix_submissions_attempts ON submissions (course, learner, quiz, question, id, outcome, uses_attempt);

CREATE INDEX ix_submissions_course ON submissions (course, id);

CREATE INDEX ix_submissions_question ON submissions (course, question, id);

CREATE INDEX ix_submissions_quiz ON submissions (course, quiz, id, question);

CREATE INDEX ix_submissions_unsettled ON submissions (course, status, id) WHERE status <> 'graded';

CREATE INDEX ix_tickets_expires_at ON tickets (purpose, expires_at);

CREATE INDEX ix_tried_copies_original ON tried_copies (original);
